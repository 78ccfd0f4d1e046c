"""Photons to ranges with numpy and scipy, as a researcher writes it today.

Photons are in order of laser cycle. Each method returns pixel, laser cycle and position in bins of
every report.
"""

import numpy as np
from scipy.ndimage import gaussian_filter1d
from scipy.signal import find_peaks
from scipy.special import gammainc


def keys(photons, bins):
    """A number for each pixel and bin."""
    return photons.pixel.astype("i8") * bins + photons.bin


def spans(cycle, cycles, length):
    """The slices of photons of every ``length`` laser cycles."""
    edges = np.searchsorted(cycle, np.arange(0, cycles + 1, length))
    return [slice(*pair) for pair in zip(edges, edges[1:])]


def histograms(keys, pixels, bins):
    """The photons of each pixel and bin."""
    return np.bincount(keys, minlength=pixels * bins).reshape(pixels, bins)


def centroid(counts, peak, background, half_width):
    """The centroid around the peak of each row, minus the background."""
    around = peak[:, None] + np.arange(-half_width, half_width + 1)
    inside = (around >= 0) & (around < counts.shape[1])
    near = np.take_along_axis(counts, around.clip(0, counts.shape[1] - 1), axis=1)
    signal = np.where(inside, near - background[:, None], 0)
    return ((around + 0.5) * signal).sum(axis=1) / signal.sum(axis=1)


def joined(reports):
    """Reports as three arrays."""
    none = [np.empty(0, int), np.empty(0, int), np.empty(0)]
    return [np.concatenate(column) for column in zip(none, *reports)]


def highest(counts):
    """The three neighbours with the most photons in each row, and the mean of all other bins."""
    window = counts[:, :-2] + counts[:, 1:-1] + counts[:, 2:]
    peak = window.argmax(axis=1)
    height = np.take_along_axis(window, peak[:, None], axis=1)[:, 0]
    background = (counts.sum(axis=1) - height) / (counts.shape[1] - 3)
    return peak + 1, height, background


def frames_with_find_peaks(photons, pixels, bins, exposure, min_photons, z, sigma, half_width):
    """Frames: smoothed with the pulse, then peaks of ``z`` standard deviations by scipy."""
    key, reports = keys(photons, bins), []
    variance = 1 / (2 * np.sqrt(np.pi) * sigma)  # of smoothed counts, relative to their mean
    for frame, span in enumerate(spans(photons.cycle, photons.cycles, exposure)):
        counts = histograms(key[span], pixels, bins)
        _, height, background = highest(counts)
        pixel = np.flatnonzero(height >= min_photons)
        counts, background = counts[pixel], background[pixel]
        smooth = gaussian_filter1d(counts.astype(float), sigma, axis=1)
        threshold = background + z * np.sqrt(background * variance)
        for row in np.flatnonzero(smooth.max(axis=1) >= threshold):
            peaks, found = find_peaks(smooth[row], height=threshold[row])
            if peaks.size:
                peak = peaks[[found["peak_heights"].argmax()]]
                position = centroid(counts[[row]], peak, background[[row]], half_width)
                reports.append((pixel[[row]], [(frame + 1) * exposure], position))
    return joined(reports)


def stands_clear(height, expected, k):
    """Whether Poisson counts reach ``height`` with a probability below ``10 ** -k``."""
    return gammainc(np.maximum(height, 1), expected) < 10.0**-k


def frames(photons, pixels, bins, exposure, min_photons, k, half_width):
    """Frames without a loop over pixels."""
    key, reports = keys(photons, bins), []
    for frame, span in enumerate(spans(photons.cycle, photons.cycles, exposure)):
        counts = histograms(key[span], pixels, bins)
        peak, height, background = highest(counts)
        pixel = np.flatnonzero(stands_clear(height, 3 * background, k) & (height >= min_photons))
        position = centroid(counts[pixel], peak[pixel], background[pixel], half_width)
        reports.append((pixel, np.full(pixel.size, (frame + 1) * exposure), position))
    return joined(reports)


def asynchronous(photons, pixels, bins, min_photons, k, half_width, x=4, l2=2000):
    """Each pixel reports as soon as its peak is significant, and then starts over."""
    key, reports = keys(photons, bins), []
    counts, began = np.zeros((pixels, bins), int), np.zeros(pixels, int)
    for look, span in enumerate(spans(photons.cycle, photons.cycles, x)):
        counts += histograms(key[span], pixels, bins)
        now = (look + 1) * x
        peak, height, background = highest(counts)
        clear = stands_clear(height, 3 * background, k) & (height >= min_photons)
        pixel = np.flatnonzero(clear)
        if pixel.size:
            position = centroid(counts[pixel], peak[pixel], background[pixel], half_width)
            reports.append((pixel, np.full(pixel.size, now), position))
        over = clear | (now - began >= l2)
        counts[over], began[over] = 0, now
    return joined(reports)
