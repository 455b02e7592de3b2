// The manner of people who vary nearly as much as those of SBU, K3HI and Kinder together (docs/synthesis.md says where
// less): left hands as often as right ones, hips that face elsewhere, near and far, quick and slow, and gestures that
// nobody announces. A task's file puts its own figures over these.
#pragma once

#include "duet/tasks/synthesis/act.h"

namespace duet::synthesis {

inline constexpr RecordedManner kVariedManner = {.tempo = {0.8, 1.5, 2.3},
                                                 .bearing = {-0.55, 0.0, 0.55},
                                                 .way = {0.0, 0.1, 1.1},
                                                 .speed = {0.4, 0.75, 1.5},
                                                 .stands = 0.5,
                                                 .overlap = {0.0, 0.3, 0.8},
                                                 .reaction = {0.0, 0.25, 0.8},
                                                 .left = 0.5,
                                                 .before = {0.0, 0.4, 1.5},
                                                 .after = {0.0, 0.4, 1.3},
                                                 .height = {1.58, 1.74, 1.90},
                                                 .aside = {-0.6, 0.0, 0.6},
                                                 .stoop = {-0.05, 0.06, 0.20},
                                                 .pause = 0.4,
                                                 .breadth = 0.5,
                                                 .mirrored = 0.5};

constexpr RecordedManner varied_handshake(double until_touch) {
  RecordedManner manner = kVariedManner;
  manner.tempo = {0.8, 1.35, 2.1};
  manner.touch = {0.35, 1.35, 2.4};
  manner.until_touch = until_touch;
  manner.distance = {0.75, 1.02, 1.26};
  manner.bearing = {-0.35, 0.5, 0.95};
  manner.turn = {-0.25, 0.3, 1.0};
  manner.way = {0.0, 0.04, 0.7};
  manner.overlap = {0.3, 0.7, 1.0};
  manner.both_hands = 0.06;
  return manner;
}

// Bearings are those of `recorded`.
constexpr RecordedManner varied_hug(const RecordedManner& recorded) {
  RecordedManner manner = kVariedManner;
  manner.tempo = {1.0, 1.45, 2.2};
  manner.touch = {0.05, 0.2, 1.4};
  manner.until_touch = recorded.until_touch;
  manner.distance = {0.15, 0.22, 0.45};
  manner.bearing = recorded.bearing;
  manner.way = {0.4, 0.85, 1.3};
  manner.speed = {1.3, 1.9, 2.6};
  manner.stands = 0.05;
  manner.overlap = {0.1, 0.26, 0.45};
  manner.reaction = {0.05, 0.38, 0.8};
  manner.before = {0.5, 1.0, 1.9};
  manner.pause = 0.05;
  return manner;
}

// A strike is a touch of so long. [s]
constexpr RecordedManner varied_strike(const Deciles& contact) {
  RecordedManner manner = kVariedManner;
  manner.distance = {0.75, 1.0, 1.3};
  manner.contact = contact;
  return manner;
}

// A gesture is made before somebody who stands still half the time.
constexpr RecordedManner varied_gesture(double both_hands) {
  RecordedManner manner = kVariedManner;
  manner.distance = {0.9, 1.5, 2.4};
  manner.before = {0.0, 0.8, 2.2};
  manner.after = {0.1, 0.8, 1.7};
  manner.both_hands = both_hands;
  manner.still = 0.5;
  return manner;
}

}  // namespace duet::synthesis
