// The values of settings, made from the tables of the options with DTOF_BLESS=1 cargo test -p dtof-live

/** By key: names, or what a field for a number needs. */
export const VALUES = {
  rule: ["paper", "average", "window"],
  alpha: { type: "number", min: 0, step: "any" },
  window: { type: "number", min: 1, step: 1 },
  z: { type: "number", min: 0, step: "any" },
  min_count: { type: "number", min: 1, step: 1 },
  x: { type: "number", min: 1, step: 1 },
  l1: { type: "number", min: 0, step: 1 },
  l2: { type: "number", min: 0, step: 1 },
  gate: { type: "number", min: 0, step: 1 },
  sigma_bins: { type: "number", min: 0, step: "any" },
  dead_time: { type: "number", min: 0, step: 1 },
  estimator: ["centroid", "window"],
  echoes: { type: "number", min: 1, step: 1 },
  binning: { type: "number", min: 0, step: 1 },
  patience: { type: "number", min: 1, step: 1 },
};
