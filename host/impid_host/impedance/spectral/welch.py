"""How Welch's method cuts a record into segments, and how many averages they are worth.

Source: [P] Sec. III-A for the two settings; P. D. Welch, IEEE Trans. Audio Electroacoust. 15 (1967) 70-73 for
the variance of overlapping segments.
"""

from dataclasses import dataclass

from impid_host.signals.density import hann


@dataclass(frozen=True, slots=True)
class WelchSetting:
    """How a record is cut into segments: [P]'s N_FFT, N_WND, N_OVL, all in samples, with a Hann window.

    `n_fft` beyond `n_window` pads with zeros: it interpolates the spectrum and adds no resolution.
    """

    n_fft: int
    n_window: int
    n_overlap: int

    def __post_init__(self) -> None:
        if not 0 <= self.n_overlap < self.n_window <= self.n_fft:
            raise ValueError(f"a Welch setting needs 0 <= n_overlap < n_window <= n_fft, not {self}")

    @property
    def step(self) -> int:
        """Samples from the start of one segment to the start of the next."""
        return self.n_window - self.n_overlap

    def segments(self, samples: int) -> int:
        """Whole segments in a record of that many samples ([P]'s N_MNS)."""
        return max(0, (samples - self.n_overlap) // self.step)

    def resolution_Hz(self, fs: float) -> float:
        """Smallest frequency that one window resolves, fs / N_WND ([P]: 0.061 and 0.244 Hz)."""
        return fs / self.n_window

    def scaled(self, fs: float, fs_reference: float = 500.0) -> "WelchSetting":
        """The same durations at another sampling rate, so that resolution and averages stay as published."""
        ratio = fs / fs_reference
        window = round(self.n_window * ratio)
        return WelchSetting(
            max(round(self.n_fft * ratio), window), window, min(round(self.n_overlap * ratio), window - 1)
        )


# [P]'s two settings at 500 Hz: 5 and 45 segments of a 50 s trial.
FINE = WelchSetting(n_fft=8192, n_window=8192, n_overlap=4096)
SMOOTH = WelchSetting(n_fft=8192, n_window=2048, n_overlap=1536)


def independent_averages(setting: WelchSetting, samples: int) -> float:
    """How many independent segments the overlapping ones are worth, in terms of variance (Welch 1967).

    [P] counts every segment as independent (5 and 45); 75 % overlap makes 45 segments worth 23.
    """
    segments = setting.segments(samples)
    window = hann(setting.n_window)
    total = float(segments)
    for lag in range(1, min(segments, -(-setting.n_window // setting.step))):
        shift = lag * setting.step
        correlation = float(window[: setting.n_window - shift] @ window[shift:] / (window @ window)) ** 2
        total += 2.0 * (segments - lag) * correlation
    return segments**2 / total
