// What a training says of its model, made up.

const ROOMS = ["bath", "bedroom", "hall", "kitchen", "study"];

const rate = (n_correct, n_frames) => ({
  n_correct,
  n_frames,
  rate: n_frames > 0 ? n_correct / n_frames : null,
});

/** A report of a model that is so good, from 0 to 1. */
export function report(quality, n_frames) {
  const each = Math.round(n_frames / ROOMS.length);
  const confusion = ROOMS.map((_, shown) => {
    const right = Math.round(each * Math.min(1, quality + 0.06 * ((shown % 3) - 1)));
    const wrong = each - right;
    return ROOMS.map((__, answered) => {
      if (answered === shown) return right;
      if (answered === (shown + 1) % ROOMS.length) return Math.ceil(wrong * 0.6);
      return answered === (shown + 2) % ROOMS.length ? Math.floor(wrong * 0.4) : 0;
    });
  });
  const by_place = confusion.map((row, at) =>
    rate(
      row[at],
      row.reduce((a, b) => a + b),
    ),
  );
  const n_right = by_place.reduce((sum, { n_correct }) => sum + n_correct, 0);
  const overall = rate(n_right, each * ROOMS.length);
  const known = Math.round(n_right * quality * 0.85);
  return {
    model: "models/home/4",
    card: {
      description: "",
      simulated: false,
      trained_by: "roomsight 0.2.0",
      n_frames,
      sequences: ["2025-11-20-0858-02", "2025-11-22-2001-44", "inbox-2025-11-24"],
      measured: [{ data: "held-out sequences", n_frames: overall.n_frames, rate: overall.rate }],
      choice: {
        chosen: 1,
        tallies: [
          {
            name: "bag",
            opinions: ["bag", "patterns"],
            n_right: n_right - 21,
            n_frames: overall.n_frames,
          },
          {
            name: "network",
            opinions: ["bag", "patterns", "vector"],
            n_right,
            n_frames: overall.n_frames,
          },
        ],
      },
    },
    held_out: {
      places: ROOMS,
      confusion,
      overall,
      by_place,
      mean_by_place: by_place.reduce((sum, { rate }) => sum + rate, 0) / ROOMS.length,
      without_border: rate(0, 0),
      only_border: rate(0, 0),
    },
    not_held_out: [
      { reason: "without anything to recognize them by", n_frames: 2, rooms: ["hall"] },
    ],
    verdict: {
      guessing: 0.2,
      is_better_than_guessing: true,
      knows: true,
      knowledge: {
        known: rate(Math.round(known * 0.97), known),
        right_known: rate(Math.round(known * 0.97), n_right),
        new_unknown: rate(18, 20),
        auroc: 0.93,
        calibration_error: 0.16 * (1.05 - quality),
        reliability: [0.25, 0.4, 0.55, 0.7, 0.85, 0.97].map((probability, at) => ({
          probability,
          rate: rate(
            Math.round((8 + at * 12) * Math.min(1, probability * (0.8 + quality / 5))),
            8 + at * 12,
          ),
        })),
      },
      learning_curve: { rate_of_half: quality - 0.09, rate_of_all: quality },
      confused: [{ shown: "bath", answered: "bedroom", n_frames: 6 }],
      weak_rooms:
        quality < 0.85 ? [{ room: "bath", rate: quality - 0.06, n_frames: each, n_more: 30 }] : [],
      rooms_of_one_drive: ["bath"],
    },
  };
}
