"""Runs a kernel in SASS, NVIDIA's machine code as nvdisasm prints it, on numpy, and counts what it issues.

It knows the instructions that the kernels of curvelax are compiled to, and stops at any other. A workgroup is a list of
warps of 32 lanes that meet at barriers. Threads that have parted meet again at BSYNC.

Times are those of one workgroup alone, issued in order: an instruction waits until its operands are there, and takes
the slot of one cycle. PIPES has the latencies, which are assumed, and the cycles for which an instruction occupies its
pipe in one of the four parts of a multiprocessor, from the table of throughputs for compute capability 9.0 in the CUDA
programming guide. Not modelled: caches, conflicts of banks, fetching instructions, the time a branch takes beyond
BRANCH.
"""

import re
from collections import Counter

import numpy as np

LANES, SCHEDULERS = 32, 4
ALL = (1 << LANES) - 1
# Where the constants have the addresses of the buffers, and the upper half of addresses of a thread's own memory.
CONSTANT_BASE, LOCAL = 0x210, 0x7F
BRANCH = 8

# Name of the pipe, pattern of the instructions, cycles in the pipe, cycles until the result is there.
PIPES = [
    ("f64", r"D(FMA|ADD|MUL|SETP)", 2, 8),
    ("special", r"MUFU|F2I|I2F\b|FRND|FCHK", 8, 20),
    ("shuffle", r"SHFL", 4, 25),
    ("workgroup memory", r"LDS|STS", 4, 25),
    ("device memory", r"LDG|STG|LDL|STL|LD\.|ST\.", 4, 40),
    ("constant", r"LDC|ULDC|S2R|S2UR|CS2R", 2, 10),
    ("barrier", r"BAR", 1, 20),
    ("control", r"BRA|BSSY|BSYNC|BREAK|CALL|RET|EXIT|WARPSYNC|NOP", 1, 0),
    ("f32", r"F(FMA|ADD|MUL)|IMAD\.MOV|HFMA2", 1, 4),
    ("integer", r"", 2, 4),
]

COMPARE = {
    "LT": lambda a, b: a < b, "LE": lambda a, b: a <= b, "GT": lambda a, b: a > b, "GE": lambda a, b: a >= b,
    "EQ": lambda a, b: a == b, "NE": lambda a, b: (a != b) & (a == a) & (b == b),
    "LTU": lambda a, b: ~(a >= b), "LEU": lambda a, b: ~(a > b), "GTU": lambda a, b: ~(a <= b),
    "GEU": lambda a, b: ~(a < b), "EQU": lambda a, b: (a == b) | (a != a) | (b != b), "NEU": lambda a, b: a != b,
    "NAN": lambda a, b: (a != a) | (b != b),
}  # fmt: skip
ARRAYS = {}


def lanes_of(mask):
    """The mask as an array."""
    if mask not in ARRAYS:
        ARRAYS[mask] = np.array([mask >> lane & 1 for lane in range(LANES)], bool)
    return ARRAYS[mask]


def mask_of(array):
    """The array as a mask."""
    return int.from_bytes(np.packbits(array, bitorder="little").tobytes(), "little")


class Instruction:
    """One line of the listing, its operands, and what it reads and writes."""

    def __init__(self, address, text):
        text = re.sub(r"\s*\(\*.*?\*\)", "", text)
        self.address, self.guard, self.text = address, None, text
        if text.startswith("@"):
            self.guard, text = text[1:].split(None, 1)
        self.name, _, operands = text.partition(" ")
        self.parts = self.name.split(".")
        self.operands = [o.strip().replace(".reuse", "") for o in operands.split(",")] if operands.strip() else []
        self.base = self.parts[0]
        self.pipe, self.cycles, self.latency = next(
            (name, cycles, latency) for name, pattern, cycles, latency in PIPES if re.match(pattern, self.name)
        )
        self.sources, self.targets = set(), set()
        self.run = None


class Listing:
    """The instructions of the kernel by address, and its labels."""

    def __init__(self, text):
        self.code, self.labels, waiting = {}, {}, []
        for line in text.splitlines():
            if label := re.match(r"^([.$\w]+):\s*$", line):
                waiting.append(label[1])
            elif found := re.match(r"^\s+/\*([0-9a-f]+)\*/\s+(.*?)\s*;", line):
                address = int(found[1], 16)
                self.labels.update((label, address) for label in waiting)
                waiting = []
                self.code[address] = Instruction(address, found[2])


class Warp:
    """32 lanes: registers, predicates, uniform registers, and where each group of lanes is."""

    def __init__(self, number, local_bytes=1 << 12):
        self.number = number
        self.r = np.zeros((257, LANES), np.uint32)
        self.p = np.zeros((8, LANES), bool)
        self.p[7] = True
        self.ur, self.up = [0] * 64, [False] * 7 + [True]
        self.b = [[0] * LANES for _ in range(16)]
        self.local = np.zeros((LANES, local_bytes // 4), np.uint32)
        self.groups = {0: ALL}
        self.at_bsync, self.at_warpsync, self.barrier, self.live = {}, {}, None, ALL
        self.now, self.ready = 0, {}


class Machine:
    """Compiles the listing to functions of a warp and a mask, and runs a workgroup of them."""

    def __init__(self, listing, constants, buffers, threads, shared_bytes=1 << 15):
        self.listing, self.constants, self.buffers = listing, constants, buffers
        self.shared = np.zeros(shared_bytes // 4, np.uint32)
        self.warps = [Warp(number) for number in range(threads // LANES)]
        self.issued, self.count, self.busy = 0, Counter(), Counter()
        for instruction in listing.code.values():
            self.compile(instruction)

    # Operands.

    def integer(self, i, text):
        """A reader of 32 bits."""
        if match := re.fullmatch(r"([-~]?)(\|?)(U?)R(Z|\d+)\|?", text):
            sign, size, uniform, name = match.groups()
            index = 256 if name == "Z" else int(name)
            if name != "Z":
                i.sources.add((uniform + "R", index))
            if uniform:
                read = (lambda w: np.uint32(w.ur[index])) if name != "Z" else (lambda w: np.uint32(0))
            else:
                read = lambda w: w.r[index]
            if size:
                raise NotImplementedError(i.text)
            if sign == "-":
                return lambda w: (~read(w)) + np.uint32(1)
            return (lambda w: ~read(w)) if sign == "~" else read
        if match := re.fullmatch(r"c\[0x0\]\[(0x[0-9a-f]+)\]", text):
            value = np.uint32(self.constants[int(match[1], 16)])
        elif re.fullmatch(r"-?0x[0-9a-f]+|-?\d+", text):
            value = np.uint32(int(text, 0) & 0xFFFFFFFF)
        else:
            value = np.float32(self.number(text)).view(np.uint32)
        return lambda w: value

    @staticmethod
    def number(text):
        """A literal of floating point."""
        return float(text.replace("QNAN", "nan").replace("INF", "inf"))

    def floating(self, i, text, double=False):
        """A reader of f32, or of f64 in two registers."""
        match = re.fullmatch(r"(-?)(\|?)(U?)R(Z|\d+)(\.64)?\|?", text)
        if match is None:
            if text.startswith(("c[", "0x")):
                raise NotImplementedError(i.text)
            value = (np.float64 if double else np.float32)(self.number(text))
            return lambda w: value
        minus, size, uniform, name = match.groups()[:4]
        if name == "Z":
            value = (np.float64 if double else np.float32)(-0.0 if minus else 0.0)
            return lambda w: value
        index = int(name)
        i.sources.update((uniform + "R", index + more) for more in range(2 if double else 1))
        if uniform and double:
            read = lambda w: np.uint64(w.ur[index] | w.ur[index + 1] << 32).view(np.float64)
        elif uniform:
            read = lambda w: np.uint32(w.ur[index]).view(np.float32)
        elif double:
            read = lambda w: (w.r[index].astype(np.uint64) | w.r[index + 1].astype(np.uint64) << 32).view(np.float64)
        else:
            read = lambda w: w.r[index].view(np.float32)
        if size:
            return (lambda w: -np.abs(read(w))) if minus else (lambda w: np.abs(read(w)))
        return (lambda w: -read(w)) if minus else read

    def wide(self, i, text):
        """A reader of 64 bits in two registers."""
        match = re.fullmatch(r"(U?)R(Z|\d+)(\.64)?", text)
        if match[2] == "Z":
            return lambda w: np.uint64(0)
        low = self.integer(i, f"{match[1]}R{match[2]}")
        high = self.integer(i, f"{match[1]}R{int(match[2]) + 1}")
        return lambda w: np.uint64(low(w)) | np.uint64(high(w)) << np.uint64(32)

    def predicate(self, i, text):
        """A reader of a predicate."""
        minus, uniform, name = re.fullmatch(r"(!?)(U?)P(T|\d)", text).groups()
        index = 7 if name == "T" else int(name)
        i.sources.add((uniform + "P", index))
        read = (lambda w: w.up[index]) if uniform else (lambda w: w.p[index])
        return (lambda w: np.logical_not(read(w))) if minus else read

    # Results.

    def put(self, i, text, count=1):
        """A writer of registers."""
        uniform, name = re.fullmatch(r"(U?)R(Z|\d+)", text).groups()
        if name == "Z":
            return lambda w, lanes, *values: None
        index = int(name)
        i.targets.update((uniform + "R", index + more) for more in range(count))
        if uniform:
            def write(w, lanes, *values):
                for more, value in enumerate(values):
                    w.ur[index + more] = int(np.ravel(value)[0])
        else:
            def write(w, lanes, *values):
                for more, value in enumerate(values):
                    np.copyto(w.r[index + more], value, where=lanes, casting="unsafe")
        return write

    def put_wide(self, i, text):
        """A writer of 64 bits, or of f64."""
        write = self.put(i, text, 2)
        def split(w, lanes, value):
            value = np.asarray(value)
            value = value.view(np.uint64) if value.dtype == np.float64 else value.astype(np.uint64)
            low, high = value & np.uint64(0xFFFFFFFF), value >> np.uint64(32)
            write(w, lanes, low.astype(np.uint32), high.astype(np.uint32))
        return split

    def put_floating(self, i, text):
        """A writer of f32."""
        write = self.put(i, text)
        return lambda w, lanes, value: write(w, lanes, np.asarray(value, np.float32).view(np.uint32))

    def put_predicate(self, i, text):
        """A writer of a predicate."""
        uniform, name = re.fullmatch(r"(U?)P(T|\d)", text).groups()
        if name == "T":
            return lambda w, lanes, value: None
        index = int(name)
        i.targets.add((uniform + "P", index))
        if uniform:
            def write(w, lanes, value):
                w.up[index] = bool(np.ravel(value)[0])
        else:
            def write(w, lanes, value):
                np.copyto(w.p[index], value, where=lanes)
        return write

    # Instructions.

    def compile(self, i):
        """Gives an instruction its function of a warp and the lanes that it is for."""
        i.guarded = self.predicate(i, i.guard) if i.guard else None
        if i.pipe == "control" or i.base in ("BAR", "ENDCOLLECTIVE"):
            i.extra = None
            if i.name == "BRA" and len(i.operands) == 2:
                i.extra = self.predicate(i, i.operands[0])
            elif i.base == "RET":
                i.extra = self.integer(i, i.operands[0].split()[0])
            return
        if (translate := getattr(self, "do_" + i.base.lower(), None)) is None:
            i.run = self.unknown(i)
        else:
            i.run = translate(i, i.operands, i.parts)

    @staticmethod
    def unknown(i):
        def stop(w, lanes):
            raise NotImplementedError(i.text)
        return stop

    def map(self, i, write, function, *readers):
        return lambda w, lanes: write(w, lanes, function(*(read(w) for read in readers)))

    def do_mov(self, i, o, parts):
        return self.map(i, self.put(i, o[0]), lambda a: a, self.integer(i, o[1]))

    do_umov = do_r2ur = do_mov

    def do_hfma2(self, i, o, parts):
        assert o[1:3] == ["-RZ", "RZ"]
        high, low = (int(np.float16(self.number(text)).view(np.uint16)) for text in o[3:5])
        value, write = np.uint32(high << 16 | low), self.put(i, o[0])
        return lambda w, lanes: write(w, lanes, value)

    def do_cs2r(self, i, o, parts):
        assert o[1] == "SRZ"
        write = self.put(i, o[0], 2)
        return lambda w, lanes: write(w, lanes, np.uint32(0), np.uint32(0))

    def do_s2r(self, i, o, parts):
        write = self.put(i, o[0])
        if o[1] == "SR_TID.X":
            return lambda w, lanes: write(w, lanes, np.arange(LANES, dtype=np.uint32) + np.uint32(LANES * w.number))
        if o[1] == "SR_LANEID":
            return lambda w, lanes: write(w, lanes, np.arange(LANES, dtype=np.uint32))
        assert o[1] in ("SR_CgaCtaId", "SR_CTAID.X"), i.text
        return lambda w, lanes: write(w, lanes, np.uint32(0))

    do_s2ur = do_s2r

    def do_ldc(self, i, o, parts):
        address, count = int(re.fullmatch(r"c\[0x0\]\[(0x[0-9a-f]+)\]", o[1])[1], 16), 2 if "64" in parts else 1
        values = [np.uint32(self.constants[address + 4 * more]) for more in range(count)]
        write = self.put(i, o[0], count)
        return lambda w, lanes: write(w, lanes, *values)

    do_uldc = do_ldc

    def do_imad(self, i, o, parts):
        if "WIDE" in parts or "HI" in parts:
            assert "U32" in parts
            a, b, c = self.integer(i, o[1]), self.integer(i, o[2]), self.wide(i, o[3])
            sum_of = lambda a, b, c: np.uint64(a) * np.uint64(b) + c
            if "WIDE" in parts:
                return self.map(i, self.put_wide(i, o[0]), sum_of, a, b, c)
            return self.map(i, self.put(i, o[0]), lambda *abc: sum_of(*abc) >> np.uint64(32), a, b, c)
        readers = [self.integer(i, text) for text in o[1:4]]
        readers.append(self.predicate(i, o[4]) if "X" in parts else lambda w: np.uint32(0))
        return self.map(i, self.put(i, o[0]), lambda a, b, c, x: a * b + c + np.asarray(x, np.uint32), *readers)

    do_uimad = do_imad

    def do_iadd3(self, i, o, parts):
        o = list(o)
        carried = self.put_predicate(i, o.pop(1)) if re.fullmatch(r"U?P(T|\d)", o[1]) else None
        if re.fullmatch(r"U?P(T|\d)", o[1]):
            raise NotImplementedError(i.text)
        readers = [self.integer(i, text) for text in o[1:4]]
        assert carried is None or not any(text.startswith(("-", "~")) for text in o[1:4]), i.text
        more = self.predicate(i, o[4]) if "X" in parts else lambda w: np.uint32(0)
        write = self.put(i, o[0])
        def run(w, lanes):
            total = sum(np.asarray(read(w)).astype(np.uint64) for read in readers) + np.asarray(more(w), np.uint64)
            write(w, lanes, (total & np.uint64(0xFFFFFFFF)).astype(np.uint32))
            if carried:
                carried(w, lanes, (total >> np.uint64(32)) > 0)
        return run

    do_uiadd3 = do_iadd3

    def do_viadd(self, i, o, parts):
        return self.map(i, self.put(i, o[0]), lambda a, b: a + b, self.integer(i, o[1]), self.integer(i, o[2]))

    def do_vimnmx(self, i, o, parts, adds=False):
        kind = np.uint32 if "U32" in parts else np.int32
        least = o[-1] == "PT"
        readers = [self.integer(i, text) for text in o[1:-1]]
        def choose(*values):
            if adds:
                values = (values[0] + values[1], values[2])
            a, b = (np.asarray(value, np.uint32).view(kind) for value in values)
            return (np.minimum(a, b) if least else np.maximum(a, b)).view(np.uint32)
        return self.map(i, self.put(i, o[0]), choose, *readers)

    def do_viaddmnmx(self, i, o, parts):
        return self.do_vimnmx(i, o, parts, adds=True)

    def do_lea(self, i, o, parts):
        o = list(o)
        carried = self.put_predicate(i, o.pop(1)) if re.fullmatch(r"U?P(T|\d)", o[1]) else None
        write = self.put(i, o[0])
        a, b = self.integer(i, o[1]), self.integer(i, o[2])
        if "HI" in parts:
            c, shift = self.integer(i, o[3]), np.uint64(int(o[4], 0))
            more = self.predicate(i, o[5]) if len(o) > 5 else lambda w: 0
            def run(w, lanes):
                whole = (np.uint64(c(w)) << np.uint64(32) | a(w).astype(np.uint64)) << shift
                write(w, lanes, (whole >> np.uint64(32)) + b(w) + np.asarray(more(w), np.uint64))
            return run
        shift = np.uint64(int(o[3], 0))
        def run_low(w, lanes):
            low = (np.asarray(a(w)).astype(np.uint64) << shift) & np.uint64(0xFFFFFFFF)
            total = low + np.asarray(b(w)).astype(np.uint64)
            write(w, lanes, (total & np.uint64(0xFFFFFFFF)).astype(np.uint32))
            if carried:
                carried(w, lanes, (total >> np.uint64(32)) > 0)
        return run_low

    do_ulea = do_lea

    def do_shf(self, i, o, parts):
        a, shift, c = self.integer(i, o[1]), self.integer(i, o[2]), self.integer(i, o[3])
        big = np.uint64(32)
        def run(a, shift, c):
            a, c = np.asarray(a).astype(np.uint64), np.asarray(c).astype(np.uint64)
            shift = np.minimum(np.asarray(shift).astype(np.uint64), np.uint64(63 if "U64" in parts else 32))
            if parts[1] == "R":
                return (c << big | a) >> (big + shift) if "HI" in parts else (c << big | a) >> shift
            return ((c << big | a) << shift) >> big if "HI" in parts else a << shift
        return self.map(i, self.put(i, o[0]), lambda *v: run(*v) & np.uint64(0xFFFFFFFF), a, shift, c)

    do_ushf = do_shf

    def do_lop3(self, i, o, parts):
        o = list(o)
        told = self.put_predicate(i, o.pop(0)) if re.fullmatch(r"U?P(T|\d)", o[0]) else None
        write, readers, table = self.put(i, o[0]), [self.integer(i, text) for text in o[1:4]], int(o[4], 0)
        def run(w, lanes):
            abc, value = [read(w) for read in readers], np.zeros(LANES, np.uint32)
            for row in range(8):
                if table >> row & 1:
                    bits = np.uint32(0xFFFFFFFF)
                    for place, operand in zip((4, 2, 1), abc):
                        bits = bits & (operand if row & place else ~operand)
                    value = value | bits
            write(w, lanes, value)
            if told:
                told(w, lanes, value != 0)
        return run

    do_ulop3 = do_lop3

    def do_plop3(self, i, o, parts):
        writes = [self.put_predicate(i, text) for text in o[:2]]
        readers, tables = [self.predicate(i, text) for text in o[2:5]], [int(text, 0) for text in o[5:7]]
        def run(w, lanes):
            a, b, c = (np.broadcast_to(read(w), LANES).astype(int) for read in readers)
            row = 4 * a + 2 * b + c
            for write, table in zip(writes, tables):
                write(w, lanes, (table >> row & 1).astype(bool))
        return run

    def do_p2r(self, i, o, parts):
        mask, kept = int(o[3], 0), self.integer(i, o[2])
        i.sources.update(("P", index) for index in range(7) if mask >> index & 1)
        def value(w):
            bits = sum(w.p[index].astype(np.uint32) << np.uint32(index) for index in range(7))
            return bits & np.uint32(mask) | kept(w) & np.uint32(~mask & 0xFFFFFFFF)
        write = self.put(i, o[0])
        return lambda w, lanes: write(w, lanes, value(w))

    def do_up2ur(self, i, o, parts):
        mask, write = int(o[3], 0), self.put(i, o[0])
        assert o[2] == "URZ"
        i.sources.update(("UP", index) for index in range(7) if mask >> index & 1)
        return lambda w, lanes: write(w, lanes, np.uint32(sum(w.up[index] << index for index in range(7)) & mask))

    def do_voteu(self, i, o, parts):
        assert parts[1] == "ANY" and len(o) == 2
        write, read = self.put_predicate(i, o[0]), self.predicate(i, o[1])
        return lambda w, lanes: write(w, lanes, (np.broadcast_to(read(w), LANES) & lanes).any())

    def do_sel(self, i, o, parts):
        readers = [self.integer(i, o[1]), self.integer(i, o[2]), self.predicate(i, o[3])]
        return self.map(i, self.put(i, o[0]), lambda a, b, p: np.where(p, a, b), *readers)

    do_usel = do_sel

    def do_fsel(self, i, o, parts):
        readers = [self.floating(i, o[1]), self.floating(i, o[2]), self.predicate(i, o[3])]
        return self.map(i, self.put_floating(i, o[0]), lambda a, b, p: np.where(p, a, b), *readers)

    def set_predicates(self, i, o, readers, compare, joined):
        first, second, more = self.put_predicate(i, o[0]), self.put_predicate(i, o[1]), self.predicate(i, o[4])
        join = {"AND": np.logical_and, "OR": np.logical_or}[joined]
        def run(w, lanes):
            a, b = (read(w) for read in readers)
            found, old = np.broadcast_to(compare(a, b), LANES), np.broadcast_to(more(w), LANES).copy()
            first(w, lanes, join(found, old))
            second(w, lanes, join(~found, old))
        return run

    def do_isetp(self, i, o, parts):
        kind = np.uint32 if "U32" in parts else np.int32
        signed = lambda a: np.asarray(a, np.uint32).view(kind)
        if "EX" not in parts:
            compare = lambda a, b: COMPARE[parts[1]](signed(a), signed(b))
            return self.set_predicates(i, o, [self.integer(i, text) for text in o[2:4]], compare, parts[-1])
        # The upper half of a comparison of 64 bits; o[5] has the result of the lower one.
        a, b, low = self.integer(i, o[2]), self.integer(i, o[3]), self.predicate(i, o[5])
        strict = {"GE": "GT", "LE": "LT"}.get(parts[1], parts[1])
        readers = [lambda w: signed(a(w)), lambda w: (signed(b(w)), low(w))]
        if parts[1] == "EQ":
            compare = lambda a, b: (a == b[0]) & b[1]
        else:
            compare = lambda a, b: COMPARE[strict](a, b[0]) | ((a == b[0]) & b[1])
        return self.set_predicates(i, o, readers, compare, parts[-2])

    do_uisetp = do_isetp

    def do_fsetp(self, i, o, parts):
        return self.set_predicates(i, o, [self.floating(i, text) for text in o[2:4]], COMPARE[parts[1]], parts[-1])

    def do_dsetp(self, i, o, parts):
        readers = [self.floating(i, text, True) for text in o[2:4]]
        if parts[1] not in ("MIN", "MAX"):
            return self.set_predicates(i, o, readers, COMPARE[parts[1]], parts[-1])
        first, second = self.put_predicate(i, o[0]), self.put_predicate(i, o[1])
        compare = COMPARE["LT" if parts[1] == "MIN" else "GT"]
        def run(w, lanes):
            a, b = (np.broadcast_to(read(w), LANES) for read in readers)
            first(w, lanes, compare(a, b) | (b != b))
            second(w, lanes, b != b)
        return run

    def do_fset(self, i, o, parts):
        assert parts[1] == "BF" and parts[3] == "AND" and o[3] == "PT"
        compare = lambda a, b: np.where(COMPARE[parts[2]](a, b), np.float32(1), np.float32(0))
        return self.map(i, self.put_floating(i, o[0]), compare, self.floating(i, o[1]), self.floating(i, o[2]))

    def do_fadd(self, i, o, parts):
        limit = (lambda v: np.minimum(np.maximum(v, np.float32(0)), np.float32(1))) if "SAT" in parts else (lambda v: v)
        readers = [self.floating(i, text) for text in o[1:3]]
        return self.map(i, self.put_floating(i, o[0]), lambda a, b: limit(a + b), *readers)

    def do_fmul(self, i, o, parts):
        return self.map(i, self.put_floating(i, o[0]), lambda a, b: a * b, *(self.floating(i, t) for t in o[1:3]))

    def do_ffma(self, i, o, parts):
        exact = lambda a, b, c: np.float64(a) * np.float64(b) + np.float64(c)
        return self.map(i, self.put_floating(i, o[0]), exact, *(self.floating(i, t) for t in o[1:4]))

    def do_fmnmx(self, i, o, parts):
        choose = np.fmin if o[3] == "PT" else np.fmax
        return self.map(i, self.put_floating(i, o[0]), choose, self.floating(i, o[1]), self.floating(i, o[2]))

    def do_dadd(self, i, o, parts):
        return self.map(i, self.put_wide(i, o[0]), lambda a, b: a + b, *(self.floating(i, t, True) for t in o[1:3]))

    def do_dmul(self, i, o, parts):
        return self.map(i, self.put_wide(i, o[0]), lambda a, b: a * b, *(self.floating(i, t, True) for t in o[1:3]))

    def do_dfma(self, i, o, parts):
        exact = lambda a, b, c: np.float64(np.longdouble(a) * np.longdouble(b) + np.longdouble(c))
        return self.map(i, self.put_wide(i, o[0]), exact, *(self.floating(i, t, True) for t in o[1:4]))

    def do_mufu(self, i, o, parts):
        function = {"RCP": lambda v: 1 / v, "RSQ": lambda v: 1 / np.sqrt(v)}[parts[1].removesuffix("64H")]
        if not parts[1].endswith("64H"):
            return self.map(i, self.put_floating(i, o[0]), function, self.floating(i, o[1]))
        def high(bits):
            value = function((np.asarray(bits).astype(np.uint64) << np.uint64(32)).view(np.float64))
            return (np.asarray(value).view(np.uint64) >> np.uint64(32)).astype(np.uint32)
        minus = o[1].startswith("-")
        read = self.integer(i, o[1].lstrip("-"))
        flipped = (lambda w: read(w) ^ np.uint32(0x80000000)) if minus else read
        return self.map(i, self.put(i, o[0]), high, flipped)

    def do_fchk(self, i, o, parts):
        # Whether a division needs the long way; as far as known, also where the dividend is zero.
        write, a, b = self.put_predicate(i, o[0]), self.floating(i, o[1]), self.floating(i, o[2])
        normal = lambda v: (np.abs(v) > 2.0**-100) & (np.abs(v) < 2.0**100)
        return lambda w, lanes: write(w, lanes, np.broadcast_to(~(normal(a(w)) & normal(b(w))), LANES))

    def do_frnd(self, i, o, parts):
        assert {*parts[1:]} <= {"FLOOR", "F64"}, i.text
        whole = np.floor if "FLOOR" in parts else np.rint
        if "F64" in parts:
            return self.map(i, self.put_wide(i, o[0]), whole, self.floating(i, o[1], True))
        return self.map(i, self.put_floating(i, o[0]), whole, self.floating(i, o[1]))

    def do_f2i(self, i, o, parts):
        low, high = (0, 2**32 - 1) if "U32" in parts else (-(2**31), 2**31 - 1)
        whole = lambda v: np.clip(np.trunc(np.nan_to_num(np.float64(v))), low, high).astype(np.int64).astype(np.uint32)
        return self.map(i, self.put(i, o[0]), whole, self.floating(i, o[1], "F64" in parts))

    def do_i2f(self, i, o, parts):
        kind, read = np.uint32 if "U32" in parts else np.int32, self.integer(i, o[1])
        if "F64" in parts:
            return self.map(i, self.put_wide(i, o[0]), lambda v: np.asarray(v).view(kind).astype(np.float64), read)
        return self.map(i, self.put_floating(i, o[0]), lambda v: np.asarray(v).view(kind).astype(np.float32), read)

    do_i2fp = do_i2f

    def do_shfl(self, i, o, parts):
        write, value, at = self.put(i, o[1]), self.integer(i, o[2]), self.integer(i, o[3])
        lane = np.arange(LANES)
        def run(w, lanes):
            assert lanes.all(), i.text
            other = np.broadcast_to(at(w), LANES).astype(int)
            write(w, lanes, value(w)[other % LANES if parts[1] == "IDX" else lane ^ other].copy())
        return run

    # Memory.

    def address(self, i, text):
        """A reader of addresses, 64 bits."""
        inside = re.search(r"\[([^\[\]]*)\]$", text)[1]
        readers = []
        for term in re.split(r"\+(?!$)", inside):
            if term.endswith(".64"):
                readers.append(self.wide(i, term))
            else:
                term = term.replace(".X4", "")
                value = self.integer(i, term)
                if re.match(r"-?0x", term):
                    offset = int(term, 0)
                    readers.append(lambda w, offset=offset: np.int64(offset))
                else:
                    readers.append(value)
        return lambda w: sum(np.broadcast_to(read(w), LANES).astype(np.int64) for read in readers)

    def memory(self, i, o, parts, loads, find):
        count = 4 if "128" in parts else 2 if "64" in parts else 1
        data, place = (o[0], o[1]) if loads else (o[1], o[0])
        where = self.address(i, place)
        if loads:
            write = self.put(i, data, count)
            def move(w, lanes, addresses):
                values = np.zeros((count, LANES), np.uint32)
                for lane in np.flatnonzero(lanes):
                    words, at = find(w, lane, addresses[lane])
                    values[:, lane] = words[at : at + count]
                write(w, lanes, *values)
        else:
            index = 256 if data == "RZ" else int(data[1:])
            i.sources.update(("R", index + more) for more in range(count) if index < 256)
            def move(w, lanes, addresses):
                for lane in np.flatnonzero(lanes):
                    words, at = find(w, lane, addresses[lane])
                    words[at : at + count] = w.r[index : index + count, lane] if index < 256 else 0
        def run(w, lanes):
            addresses = where(w).tolist()
            # Memory serves 32 numbers a cycle to all four parts.
            different = len({addresses[lane] for lane in np.flatnonzero(lanes)})
            self.busy[i.pipe] += SCHEDULERS * max((count * different - 1) // LANES, 0)
            move(w, lanes, addresses)
        return run

    def global_at(self, w, lane, address):
        words, at = self.buffers[address >> 32], (address & 0xFFFFFFFF) >> 2
        assert at < len(words), hex(address)
        return words, at

    def anywhere(self, w, lane, address):
        """Device memory, or the thread's own."""
        if address >> 32 == LOCAL:
            return w.local[lane], (address & 0xFFFFFFFF) >> 2
        return self.global_at(w, lane, address)

    def do_ld(self, i, o, parts):
        return self.memory(i, o, parts, True, self.anywhere)

    def do_st(self, i, o, parts):
        return self.memory(i, o, parts, False, self.anywhere)

    def do_ldg(self, i, o, parts):
        return self.memory(i, o, parts, True, self.global_at)

    def do_stg(self, i, o, parts):
        return self.memory(i, o, parts, False, self.global_at)

    def do_lds(self, i, o, parts):
        return self.memory(i, o, parts, True, lambda w, lane, address: (self.shared, address >> 2))

    def do_sts(self, i, o, parts):
        return self.memory(i, o, parts, False, lambda w, lane, address: (self.shared, address >> 2))

    def do_ldl(self, i, o, parts):
        return self.memory(i, o, parts, True, lambda w, lane, address: (w.local[lane], address >> 2))

    def do_stl(self, i, o, parts):
        return self.memory(i, o, parts, False, lambda w, lane, address: (w.local[lane], address >> 2))

    # Control.

    def cost(self):
        """What has been issued: instructions, also by pipe, the cycles that pipes were busy for, and the time."""
        cost = Counter(self.count, issued=self.issued, cycles=max(w.now for w in self.warps))
        return cost + Counter({f"busy {pipe}": cycles for pipe, cycles in self.busy.items()})

    def label(self, text):
        return self.listing.labels[re.search(r"`\(([^)]*)\)", text)[1]]

    def run(self, limit=10**8):
        """Runs until all threads have ended."""
        with np.errstate(all="ignore"):
            while any(w.live for w in self.warps):
                moved = False
                for w in self.warps:
                    while w.groups:
                        self.advance(w)
                        moved = True
                        if self.issued > limit:
                            raise RuntimeError("runs too long")
                waiting = [w for w in self.warps if w.live]
                if waiting and all(w.barrier for w in waiting):
                    now = max(w.now for w in waiting)
                    for w in waiting:
                        w.groups, w.barrier, w.now = {w.barrier + 16: w.live}, None, now
                elif not moved:
                    raise RuntimeError("nothing moves")

    @staticmethod
    def join(w, pc, mask):
        w.groups[pc] = w.groups.get(pc, 0) | mask

    def release(self, w):
        """Releases the threads at a BSYNC that wait for no other any more."""
        for pc, (mask, register) in list(w.at_bsync.items()):
            lane = (mask & -mask).bit_length() - 1
            if w.b[register][lane] & w.live & ~mask == 0:
                del w.at_bsync[pc]
                self.join(w, pc + 16, mask)
        for pc, mask in list(w.at_warpsync.items()):
            if mask == w.live:
                del w.at_warpsync[pc]
                self.join(w, pc + 16, mask)

    def advance(self, w):
        """Runs the group of lanes that is furthest behind until it parts, waits or ends."""
        pc = min(w.groups)
        mask = w.groups.pop(pc)
        lanes, code = lanes_of(mask), self.listing.code
        while True:
            i = code[pc]
            self.issued += 1
            self.count[i.pipe] += 1
            self.busy[i.pipe] += i.cycles
            start = w.now
            for source in i.sources:
                start = max(start, w.ready.get(source, 0))
            w.now = start + 1
            for target in i.targets:
                w.ready[target] = start + i.latency
            active = lanes if i.guarded is None else lanes & np.broadcast_to(i.guarded(w), LANES)
            if i.run is not None:
                i.run(w, active)
                pc += 16
                if pc in w.groups:
                    self.join(w, pc, mask)
                    return
                continue
            taken = mask if i.guarded is None else mask_of(active)
            if i.base == "BRA" and i.parts[-1] == "DIV":
                assert mask == w.live, "parted at a shuffle"
                taken = 0
            elif i.extra is not None and i.base == "BRA":
                taken &= mask_of(np.broadcast_to(i.extra(w), LANES))
            if i.base in ("BRA", "CALL"):
                if taken:
                    w.now += BRANCH
                    self.join(w, self.label(i.operands[-1]), taken)
                if mask & ~taken:
                    self.join(w, pc + 16, mask & ~taken)
                return
            if i.base == "RET":
                w.now += BRANCH
                self.join(w, int(np.asarray(i.extra(w))[lanes][0]), mask)
                return
            if i.base == "BSSY":
                register = int(i.operands[0][1:])
                for lane in np.flatnonzero(active):
                    w.b[register][lane] = taken
            elif i.base == "BREAK":
                register = int(i.operands[0][1:])
                w.b[register] = [of & ~taken for of in w.b[register]]
                self.release(w)
            elif i.base == "BSYNC":
                register = int(i.operands[0][1:])
                w.at_bsync[pc] = (w.at_bsync.get(pc, (0, register))[0] | mask, register)
                self.release(w)
                return
            elif i.base == "WARPSYNC":
                w.at_warpsync[pc] = w.at_warpsync.get(pc, 0) | mask
                self.release(w)
                return
            elif i.base == "EXIT":
                w.live &= ~taken
                self.release(w)
                if mask & ~taken:
                    self.join(w, pc + 16, mask & ~taken)
                return
            elif i.base == "BAR" and taken:
                assert taken == w.live, "parted at a barrier"
                w.now += i.latency
                self.count["barriers"] += w.number == 0
                w.barrier = pc
                return
            pc += 16
            if pc in w.groups:
                self.join(w, pc, mask)
                return
