"""The studio: a local web page on which the whole chain can be inspected and changed.

settings → loop → session → page → server. What a browser shows (`charts`, `views`) is made from values without a
browser; `warm_up` compiles loops in advance. Only `server`, `browser_page` and the cards and controls on it import
NiceGUI.
"""
