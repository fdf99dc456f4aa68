"""The studio: a local page on which the whole chain can be seen and moved.

settings → loop → session → page → server; what a browser shows (`charts`, `views`) and takes home (`downloads`) is made
from values that know no browser. `warm` has the loops compiled meanwhile. Only `server`, `page` and what
stands on it (`controls`, `grey`, `parts`, `loop_card`, `sheet_card`) import NiceGUI.
"""
