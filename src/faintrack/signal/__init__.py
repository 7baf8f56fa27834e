"""From samples to scans: framing, spectra, beam power."""
