"""Turns a kernel in Metal, as naga writes it in f32, into CUDA for clang: metal_to_cuda.py IN.metal OUT.cu

metal_on_cuda.h defines the names of Metal that such a kernel uses.
"""

import re
import sys

source, out = sys.argv[1:3]
text = open(source).read()

# Types and names.
for gone in ["#include <metal_stdlib>", "#include <simd/simd.h>", "using metal::uint;"]:
    text = text.replace(gone, "")
text = re.sub(r"^constant (\w+) (\w+) =", r"static constexpr \1 \2 =", text, flags=re.M)
text = text.replace("constant ", "const ")
for metal, cuda in [
    (r"\bvec_\(", "metal::F4("),
    (r"\bpair\(", "metal::F2("),
    (r"\buint2\(", "metal::U2("),
    (r"(?<!:)\buint2 ", "metal::uint2 "),
    (r"metal::float4\(", "metal::F4("),
    (r"metal::float2\(", "metal::F2("),
    (r"metal::int4\(", "metal::I4("),
    (r"metal::uint4\(", "metal::U4("),
    (r"static_cast<(metal::\w+)>\(", r"metal::convert<\1>("),
    (r"\[\[[^\]]*\]\]", ""),
]:
    text = re.sub(metal, cuda, text)

# Arguments of the entry point: buffers become pointers, workgroup memory becomes static.
start = text.index("kernel void evolve(")
end = text.index(") {", start)
arguments = [line.strip().lstrip(",").strip() for line in text[start + len("kernel void evolve(") : end].split("\n")]
body = text[end + 3 :]
pointers, local = [], []
for argument in arguments:
    if argument.startswith("threadgroup"):
        kind, name = argument[len("threadgroup") :].strip().replace("&", "").split()
        local.append(
            f"__attribute__((shared)) static unsigned char {name}_s[sizeof({kind})] __attribute__((aligned(32)));"
            f" {kind} & {name} = *({kind}*){name}_s;"
        )
    elif "&" in argument:
        kind, name = argument.replace("device ", "").split("&")
        pointers.append(f"{kind.strip()} *__restrict__ P_{name.strip()}")
        local.append(f"{kind.strip()} & {name.strip()} = *P_{name.strip()};")

# wgpu is asked not to zero workgroup memory.
zeroing = re.search(r"if \((thread_|__local_invocation_index) == 0u\) \{", body)
if zeroing:
    body = body[: zeroing.start()] + body[body.index("metal::threadgroup_barrier", zeroing.start()) :]

entry = (
    f'extern "C" kernel void evolve({", ".join(pointers)}) {{\n'
    "metal::uint3 group = {__nvvm_read_ptx_sreg_ctaid_x(), 0, 0};\n"
    "uint thread_ = __nvvm_read_ptx_sreg_tid_x();\n"
    "uint __local_invocation_index = thread_;\n"
)
text = text[:start] + entry + "\n".join(local) + body
# Drivers inline every call.
function = r"^((?!struct|typedef|static|extern|using|//|#|constant|const)[\w:]+ [\w]+\()"
text = re.sub(function, r"static inline __attribute__((always_inline)) \1", text, flags=re.M)

with open(out, "w") as file:
    file.write('#include "metal_on_cuda.h"\n' + text + "\n#pragma clang force_cuda_host_device end\n")
