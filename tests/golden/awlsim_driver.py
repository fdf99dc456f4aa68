"""awlsim as a machine that is told what to do, line by line; in a process of its own: awlsim is GPL, heatertune is not.

Each line of stdin is a JSON list, each answer a line of JSON on stdout:
["load", source]                  load a source, the data blocks as their BEGIN says; nothing runs yet
["names", number]                 {member of a data block: [byte, bit, type]}
["read", number]                  the block's bytes as hex
["write", number, name, value]    write a member
["ob", number, interval in ms, reading]   run an organization block; OB35 is told its interval as the CPU tells it; PIW 256
                                  reads that; answer: [QB 4 as it reached the module, PQW 256, QB 4 in the process image]
awlsim never schedules OB35: whoever tells the machine is the clock.
"""

import json
import struct
import sys

import awlsim.core.main as simulator  # before the others: awlsim's modules import each other
from awlsim.awlcompiler import AwlParser
from awlsim.common.cpuconfig import S7CPUConfig
from awlsim.common.sources import AwlSource
from awlsim.core.hardware import AbstractHardwareInterface
from awlsim.core.obtemp import OBTempPresets, OBTempPresets_table

ANALOG = bytearray(2)  # PIW 256
WRITTEN = {4: 0, 256: 0}  # PQB 4, PQW 256
TOLD = bytearray(20)  # what the CPU tells OB35
CODES = {"INT": ">h", "DINT": ">i", "REAL": ">f", "TIME": ">i", "WORD": ">H"}


class Module(AbstractHardwareInterface):
    """An analog input and an analog output at byte 256, digital outputs at byte 4."""

    name = "module"

    def doStartup(self):
        pass

    def doShutdown(self):
        pass

    def readInputs(self):
        pass

    def writeOutputs(self):
        pass

    def directReadInput(self, accessWidth, accessOffset):
        assert (accessWidth, accessOffset) == (16, 256)
        return bytearray(ANALOG)

    def directWriteOutput(self, accessWidth, accessOffset, data):
        assert (accessWidth, accessOffset) in ((16, 256), (8, 4))
        WRITTEN[accessOffset] = struct.unpack(">h", bytes(data))[0] if accessWidth == 16 else data[0]
        return True


class Start(OBTempPresets):
    """The start information of OB35."""

    def __init__(self, cpu):
        OBTempPresets.__init__(self, 35, cpu)

    def generate(self, localdata):
        localdata[0:20] = TOLD


class Machine:
    """One CPU."""

    def load(self, source):
        self.known = {}
        parser = AwlParser()
        parser.parseSource(AwlSource("export", sourceBytes=source.encode("ascii")))
        self.sim = simulator.AwlSim()
        self.sim.reset()
        self.cpu = self.sim.getCPU()
        self.cpu.enableObTempPresets(True)
        self.cpu.getConf().setConfiguredMnemonics(S7CPUConfig.MNEMONICS_EN)
        self.cpu.getConf().setCycleTimeLimitUs(10_000_000)
        self.sim.registerHardwareClass(Module)
        self.sim.load(parser.getParseTree())
        self.sim.build()
        self.sim.hardwareStartup()

    def names(self, number):
        if number not in self.known:
            fields = self.cpu.getDB(number).struct.fields
            self.known[number] = {f.name: [f.offset.byteOffset, f.offset.bitOffset, str(f.dataType)] for f in fields if f.name}
        return self.known[number]

    def _bytes(self, number):
        return self.cpu.getDB(number).structInstance.memory.getRawDataBytes()

    def read(self, number):
        return bytes(self._bytes(number)).hex()

    def write(self, number, name, value):
        byte, bit, kind = self.names(number)[name]
        memory = self._bytes(number)
        if kind == "BOOL":
            memory[byte] = memory[byte] & ~(1 << bit) | (bool(value) << bit)
        else:
            code = CODES[kind]
            memory[byte:byte + struct.calcsize(code)] = struct.pack(code, value)

    def ob(self, number, interval, reading):
        TOLD[10:12] = struct.pack(">H", interval)
        ANALOG[:] = struct.pack(">h", reading)
        self.cpu._S7CPU__runOB(self.cpu.getOB(number))
        return [WRITTEN[4], WRITTEN[256], self.cpu.fetchOutputByte(4)]


def main():
    """Do what is told until stdin ends."""
    OBTempPresets_table[35] = Start
    machine = Machine()
    for line in sys.stdin:
        what, *rest = json.loads(line)
        print(json.dumps(getattr(machine, what)(*rest)), flush=True)


main()
