"""A 64-bit ARM processor with NEON, emulated: an object file of this library runs on
it, whatever the tests run on.
"""

from __future__ import annotations

import struct
from itertools import pairwise

import numpy as np
import pytest

unicorn = pytest.importorskip("unicorn")
llvm = pytest.importorskip("llvmlite.binding")

CODE, DATA, STACK, RETURN = 0x1000_0000, 0x2000_0000, 0x7000_0000, 0x0F00_0000
PAGE = 0x1000


def compiled(text: str) -> tuple[bytes, str]:
    """Object file and assembly listing of a module, for a Cortex-A72."""
    llvm.initialize_all_targets()
    llvm.initialize_all_asmprinters()
    machine = llvm.Target.from_triple(
        "aarch64-unknown-linux-gnu"
    ).create_target_machine(
        cpu="cortex-a72", features="+neon", opt=2, reloc="static", codemodel="small"
    )
    module = llvm.parse_assembly(text)
    module.triple = "aarch64-unknown-linux-gnu"
    module.verify()
    builder = llvm.create_pass_builder(
        machine, llvm.create_pipeline_tuning_options(speed_level=2)
    )
    builder.getModulePassManager().run(module, builder)
    return machine.emit_object(module), machine.emit_assembly(module)


class Sections:
    """Sections, symbols and relocations of a little-endian ELF64 object file."""

    def __init__(self, content: bytes) -> None:
        (offset,) = struct.unpack_from("<Q", content, 0x28)
        _, count, names = struct.unpack_from("<HHH", content, 0x3A)
        raw = [
            struct.unpack_from("<IIQQQQIIQQ", content, offset + 64 * i)
            for i in range(count)
        ]
        self.names = [self._text(content, raw[names][4] + header[0]) for header in raw]
        self.headers = raw
        self.bytes = [content[h[4] : h[4] + h[5]] for h in raw]

    @staticmethod
    def _text(content: bytes, at: int) -> str:
        return content[at : content.index(b"\0", at)].decode()

    def symbols(self) -> list[tuple[str, int, int]]:
        """(name, section, value)."""
        index = next(i for i, h in enumerate(self.headers) if h[1] == 2)
        table, names = self.bytes[index], self.bytes[self.headers[index][6]]
        found = []
        for at in range(0, len(table), 24):
            name, _, _, section, value, _ = struct.unpack_from("<IBBHQQ", table, at)
            found.append((self._text(names, name), section, value))
        return found

    def placed(self) -> tuple[dict[int, int], dict[int, bytearray]]:
        """Address and content of every section that is loaded (flag SHF_ALLOC)."""
        at, where, content = CODE, {}, {}
        for i, header in enumerate(self.headers):
            if header[2] & 2 and header[5]:
                at = -(-at // 64) * 64
                where[i], content[i] = at, bytearray(self.bytes[i])
                at += header[5]
        return where, content


def linked(content: bytes) -> tuple[dict[int, bytes], dict[str, int]]:
    """Loaded sections by address, and the addresses of the symbols; relocations of the
    small code model applied.
    """
    sections = Sections(content)
    where, loaded = sections.placed()
    symbols = [
        (name, where.get(section, 0) + value)
        for name, section, value in sections.symbols()
    ]
    for i, header in enumerate(sections.headers):
        if header[1] != 4 or header[7] not in where:  # SHT_RELA of a loaded section
            continue
        for at in range(0, len(sections.bytes[i]), 24):
            offset, info, addend = struct.unpack_from("<QQq", sections.bytes[i], at)
            target = symbols[info >> 32][1] + addend
            _relocate(
                loaded[header[7]],
                offset,
                info & 0xFFFFFFFF,
                target,
                where[header[7]] + offset,
            )
    return {where[i]: bytes(loaded[i]) for i in where}, dict(symbols)


def _relocate(
    section: bytearray, offset: int, kind: int, target: int, place: int
) -> None:
    """Source: ELF for the Arm 64-bit Architecture, tables of static relocations."""
    shifts = {277: 0, 278: 0, 284: 1, 285: 2, 286: 3, 299: 4}
    (word,) = struct.unpack_from("<I", section, offset)
    if kind == 275:  # R_AARCH64_ADR_PREL_PG_HI21
        pages = (target // PAGE) - (place // PAGE)
        word |= (pages & 3) << 29 | ((pages >> 2) & 0x7FFFF) << 5
    elif kind in (282, 283):  # JUMP26, CALL26
        word |= ((target - place) >> 2) & 0x3FFFFFF
    elif kind in shifts:  # LO12 of an addition or a load
        word |= ((target % PAGE) >> shifts[kind]) << 10
    elif kind in (260, 261):  # PREL64, PREL32: unwind tables, which nothing here reads
        return
    else:
        raise NotImplementedError(f"relocation {kind}")
    struct.pack_into("<I", section, offset, word)


class Arm64:
    """The emulated processor with an object file in its memory."""

    def __init__(self, content: bytes) -> None:
        from unicorn import arm64_const as registers

        self.registers = registers
        self.machine = unicorn.Uc(unicorn.UC_ARCH_ARM64, unicorn.UC_MODE_ARM)
        loaded, self.symbols = linked(content)
        end = max(at + len(part) for at, part in loaded.items())
        for start, stop in (
            (CODE, end),
            (STACK, STACK + 64 * PAGE),
            (RETURN, RETURN + PAGE),
        ):
            self.machine.mem_map(start, -(-(stop - start) // PAGE) * PAGE)
        for at, part in loaded.items():
            self.machine.mem_write(at, part)
        # floating point is off after reset: CPACR_EL1.FPEN
        self.machine.reg_write(registers.UC_ARM64_REG_CPACR_EL1, 3 << 20)

    def call(self, name: str, arrays: list[np.ndarray], numbers: list[int]) -> None:
        """Call a function of pointers and whole numbers; the arrays are changed in
        place. Eight go in registers.
        """
        machine, registers = self.machine, self.registers
        sizes = [
            0,
            *np.cumsum([-(-(a.nbytes + 64) // 64) * 64 for a in arrays]).tolist(),
        ]
        machine.mem_map(DATA, -(-(sizes[-1] + 64) // PAGE) * PAGE)
        places = [DATA + at for at, _ in pairwise(sizes)]
        for at, array in zip(places, arrays, strict=True):
            machine.mem_write(at, array.tobytes())
        values = [*places, *numbers]
        stack = STACK + 32 * PAGE
        for i, value in enumerate(values[:8]):
            machine.reg_write(getattr(registers, f"UC_ARM64_REG_X{i}"), value)
        for i, value in enumerate(values[8:]):
            machine.mem_write(stack + 8 * i, struct.pack("<q", value))
        machine.reg_write(registers.UC_ARM64_REG_SP, stack)
        machine.reg_write(registers.UC_ARM64_REG_LR, RETURN)
        machine.emu_start(self.symbols[name], RETURN)
        for at, array in zip(places, arrays, strict=True):
            array[...] = np.frombuffer(
                machine.mem_read(at, array.nbytes), array.dtype
            ).reshape(array.shape)
        machine.mem_unmap(DATA, -(-(sizes[-1] + 64) // PAGE) * PAGE)
