"""Writes the arrays beside this file, as NumPy does: python3 make.py."""

import numpy

# Capture, row, column, bin. All photons of a pixel but one are in the bin of its number.
counts = numpy.zeros((2, 2, 2, 8), dtype=numpy.uint16)
for pixel in range(8):
    counts[pixel // 4, pixel // 2 % 2, pixel % 2, pixel] = 100
counts[..., 7] += 1

numpy.save("plain.npy", counts)
numpy.save("fortran.npy", numpy.asfortranarray(counts))
numpy.save("bins_first.npy", numpy.moveaxis(counts, 3, 0).copy())
numpy.save("turned.npy", counts.transpose(2, 3, 0, 1))  # columns, bins, captures, rows
numpy.save("floats.npy", counts.astype(numpy.float32))
numpy.save("doubles.npy", counts.astype(">f8"))
numpy.savez_compressed("one.npz", counts=counts)
numpy.savez("two.npz", dark=numpy.zeros((2, 8), dtype=numpy.uint8), lit=counts)
wrong = counts.astype(numpy.float32)
wrong[1, 0, 1, 3] = 0.5
numpy.save("fraction.npy", wrong)

# 60 laser cycles of two pixels; in each the first has a photon in bin 40, each second one
# in bin 7 of the other.
photons = [(0, cycle, 40) for cycle in range(60)] + [(3, cycle, 7) for cycle in range(0, 60, 2)]
photons.sort(key=lambda photon: photon[1])
for name, dtype in {
    "list.npy": [("pixel", "<u2"), ("cycle", "<u4"), ("bin", "<u2")],
    "list_turned.npy": [("bin", ">i2"), ("time", "<f8"), ("cycle", ">u8"), ("pixel", "|u1")],
    "list_aligned.npy": numpy.dtype(
        [("bin", "u1"), ("cycle", "i8"), ("pixel", "u4")], align=True
    ),
}.items():
    array = numpy.zeros(len(photons), dtype=dtype)
    for index, (pixel, cycle, bin) in enumerate(photons):
        array[index]["pixel"], array[index]["cycle"], array[index]["bin"] = pixel, cycle, bin
    numpy.save(name, array)
