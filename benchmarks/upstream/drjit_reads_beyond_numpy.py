"""Dr.Jit's LLVM backend reads beyond the end of a NumPy array, and the process dies.

    python benchmarks/upstream/drjit_reads_beyond_numpy.py

The array ends right before a page that may not be read. Dr.Jit wraps its memory without a copy. The
kernel then loads whole SIMD packets: the last one reaches beyond the array if its start is not
aligned to packets, or if its size is no multiple of them. Seen with drjit 1.5.0, numpy 2.4.6, LLVM
23 and x86-64 (AVX-512): exit by SIGSEGV. Expected: 2006.0.

In an ordinary program the page behind an array is nearly always mapped. For arrays with a mapping
of their own (glibc: from 128 KiB on) the next page is not, and about 1.4% of their sizes end within
a packet of it. So `scenegen.rendering.tables` copies arrays to memory with a packet to spare.
"""

import ctypes
import mmap

import drjit as dr
import numpy as np
from drjit.llvm import Float

COUNT = 1003
memory = mmap.mmap(-1, 2 * mmap.PAGESIZE)
address = ctypes.addressof(ctypes.c_char.from_buffer(memory))
protect = ctypes.CDLL(None).mprotect
protect(ctypes.c_void_p(address + mmap.PAGESIZE), ctypes.c_size_t(mmap.PAGESIZE), 0)
values = np.frombuffer(memory, np.float32, COUNT, mmap.PAGESIZE - 4 * COUNT)
values[:] = 1.0
print("drjit", dr.__version__, "numpy", np.__version__, flush=True)
print(dr.sum(Float(values) + 1.0)[0])
