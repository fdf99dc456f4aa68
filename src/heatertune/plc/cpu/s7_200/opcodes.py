"""The numbers by which assembler and CPU know the instructions, grouped as the CPU tells them apart."""

from __future__ import annotations

from typing import Final

__all__ = [
    "ADD_D", "ADD_W", "AND_D", "ASSIGN", "ATCH", "CALL", "CRETI", "DIV", "DIV_R", "DTCH", "DTR", "END", "ENI", "ITD",
    "LAST_LOAD", "LAST_MOVE", "LAST_REAL", "LAST_SHIFT", "LAST_SUM", "LD", "LDD", "LDR", "LDW", "MOV_B", "MOV_D",
    "MOV_W", "MUL", "MUL_R", "PID", "PLS", "RELATIONS", "ROUND", "ROW", "SET", "SHIFT_D", "SUB_D", "SUB_W", "XOR_D",
]

#: integers of an instruction in a program's code: its number, then, for both operands, whether it is a constant, and
#: the constant or place
ROW: Final = 5

#: relations of two operands; a comparison's number is LDW, LDD or LDR plus its place here
RELATIONS: Final = ("=", "<", ">", "<=", ">=")

# what sets the top of the logic stack
LD: Final = 0
LDW: Final = 1
LDD: Final = 6
LDR: Final = 11
LAST_LOAD: Final = 15
# what is carried out whatever it is
ASSIGN: Final = 16
END: Final = 17
# what is carried out where it is 1
MOV_B: Final = 18
MOV_W: Final = 19
MOV_D: Final = 20
LAST_MOVE: Final = 20
ADD_W: Final = 21
SUB_W: Final = 22
ADD_D: Final = 23
SUB_D: Final = 24
LAST_SUM: Final = 24
MUL: Final = 25
DIV: Final = 26
AND_D: Final = 27
XOR_D: Final = 28
SHIFT_D: Final = 29
LAST_SHIFT: Final = 29
MUL_R: Final = 30
DIV_R: Final = 31
ITD: Final = 32
DTR: Final = 33
ROUND: Final = 34
PID: Final = 35
LAST_REAL: Final = 35
SET: Final = 36
CALL: Final = 37
CRETI: Final = 38
ATCH: Final = 39
DTCH: Final = 40
ENI: Final = 41
PLS: Final = 42
