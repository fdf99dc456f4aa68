"""The numbers by which assembler and CPU know the instructions, grouped as the CPU tells them apart."""

from __future__ import annotations

from typing import Final

__all__ = [
    "ADD_D", "ADD_W", "AND_D", "ASSIGN", "ATCH", "CALL", "CRETI", "DIV", "DIV_R", "DTCH", "DTR", "END", "ENI", "ITD",
    "LAST_LOAD", "LAST_MOVE", "LAST_REAL", "LAST_SHIFT", "LAST_SUM", "LD", "LDD", "LDW", "MOV_B", "MOV_D", "MOV_W",
    "MUL", "MUL_R", "PID", "PLS", "RELATIONS", "ROUND", "ROW", "SET", "SHIFT_D", "SUB_D", "SUB_W", "XOR_D",
]

#: integers of an instruction in a program's code: its number, then, for both operands, whether it is a constant, and
#: the constant or place
ROW: Final = 5

#: relations of two operands; a comparison's number is LDW or LDD plus its place here
RELATIONS: Final = ("=", "<", ">", "<=", ">=")

# what sets the top of the logic stack
LD: Final = 0
LDW: Final = 1
LDD: Final = 6
LAST_LOAD: Final = 10
# what is carried out whatever it is
ASSIGN: Final = 11
END: Final = 12
# what is carried out where it is 1
MOV_B: Final = 13
MOV_W: Final = 14
MOV_D: Final = 15
LAST_MOVE: Final = 15
ADD_W: Final = 16
SUB_W: Final = 17
ADD_D: Final = 18
SUB_D: Final = 19
LAST_SUM: Final = 19
MUL: Final = 20
DIV: Final = 21
AND_D: Final = 22
XOR_D: Final = 23
SHIFT_D: Final = 24
LAST_SHIFT: Final = 24
MUL_R: Final = 25
DIV_R: Final = 26
ITD: Final = 27
DTR: Final = 28
ROUND: Final = 29
PID: Final = 30
LAST_REAL: Final = 30
SET: Final = 31
CALL: Final = 32
CRETI: Final = 33
ATCH: Final = 34
DTCH: Final = 35
ENI: Final = 36
PLS: Final = 37
