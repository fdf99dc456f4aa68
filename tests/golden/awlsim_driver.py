"""Run an exported STL source in awlsim, scan by scan; in a process of its own, since awlsim is GPL and heatertune is not.

stdin: JSON {"source": path, "block": DB number, "rows": [[mode, SP, PV, OUT or null], …], "scan_s": number or null,
"asked": byte of the flag word that takes SP, "restart": reading while OB100 runs}.
stdout: JSON {"source": data block after OB100 as hex, "rows": [data block after each OB35 as hex, …], "names": {…}}.
A row's OUT is written to DBW6 before the call, as the user of manual mode does. With "scan_s" each row is a scan of OB1
that takes so long, on a clock of its own, instead of a call of OB35.
"""

import json
import struct
import sys

import awlsim.core.main as simulator  # before the others: awlsim's modules import each other
from awlsim.awlcompiler import AwlParser
from awlsim.common.cpuconfig import S7CPUConfig
from awlsim.common.sources import AwlSource
from awlsim.core.hardware import AbstractHardwareInterface

ANALOG = bytearray(2)  # PIW 256


class Module(AbstractHardwareInterface):
    """An analog input and an analog output at byte 256."""

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
        assert (accessWidth, accessOffset) == (16, 256)
        WRITTEN.append(struct.unpack(">h", bytes(data))[0])
        return True


WRITTEN: list = []


def main():
    """Load, restart, run the rows, tell."""
    task = json.load(sys.stdin)
    clock = [1000.0]
    if task["scan_s"] is not None:
        import awlsim.core.cpu as core  # noqa: PLC0415 - only after the simulator, see above

        core.monotonic_time = lambda: clock[0]
        core.S7CPU.updateTimestamp.__defaults__ = (core.monotonic_time,)
    parser = AwlParser()
    parser.parseSource(AwlSource.fromFile("export", task["source"]))
    sim = simulator.AwlSim()
    sim.reset()
    cpu = sim.getCPU()
    cpu.getConf().setConfiguredMnemonics(S7CPUConfig.MNEMONICS_EN)
    cpu.getConf().setCycleTimeLimitUs(10_000_000)
    sim.registerHardwareClass(Module)
    sim.load(parser.getParseTree())
    sim.build()
    ANALOG[:] = struct.pack(">h", task["restart"])
    sim.startup()
    block = cpu.getDB(task["block"])
    memory, flags = block.structInstance.memory.getRawDataBytes(), cpu.flags.getRawDataBytes()
    offsets = {f.name: [f.offset.byteOffset, f.offset.bitOffset] for f in block.struct.fields if f.name}
    after_restart, automatic = bytes(memory).hex(), flags[10] & 1
    rows = []
    for mode, setpoint, reading, output in task["rows"]:
        flags[10] = flags[10] & 0xFE | mode
        flags[task["asked"]:task["asked"] + 2] = struct.pack(">h", setpoint)
        ANALOG[:] = struct.pack(">h", reading)
        if output is not None:
            memory[6:8] = struct.pack(">h", output)
        if task["scan_s"] is None:
            cpu._S7CPU__runOB(cpu.getOB(35))
        else:
            clock[0] += task["scan_s"]
            sim.runCycle()
        rows.append(bytes(memory).hex())
    told = {"restart": after_restart, "automatic": automatic, "rows": rows, "offsets": offsets, "written": WRITTEN}
    json.dump(told, sys.stdout)


main()
