"""Photons to ranges with dtof: the counterpart of `with_numpy.py`."""

import dtof


def events(photons, bins, min_photons, z=None, **pulse):
    """Pixel, laser cycle and position in bins of every depth event.

    Without ``z`` the threshold is that of ``false_alarm=0.01``.
    """
    run = dtof.photons(
        photons.pixel, photons.cycle, photons.bin, bins=bins, cycles=photons.cycles, settings={},
        rule="window", z=z, min_count=min_photons, l1=4, l2=2000, x=4, **pulse,
    )
    return run.events["pixel"], run.events["cycle"] + 1, run.events["depth_bins"]
