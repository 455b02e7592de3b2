// The definition of a task: its words, how two people do it, and how it is told whether they did. Each task has one
// file (docs/extending.md) that says all of this; the one table of them is made from tasks/list.cmake. The rooms
// above ask the table: motion/ synthesises and proposes phases, metrics/ detects, policies/ embed the prompt.
#pragma once

#include <array>
#include <span>
#include <string_view>

#include "duet/core/task.h"
#include "duet/tasks/rules/agent.h"
#include "duet/tasks/synthesis/act.h"

namespace duet {

// The named readings of what the supplement leaves open in its detectors (docs/deviations.md): the first value of each
// is the default. Their names in text are in metrics/readings.cpp.

enum class HugSingle { kAnyHand, kSameHand, kExactlyOne, kOff };
enum class HugShoulder { kBothHands, kAnyHand, kTorsoBoth, kTorsoAny, kOff };
enum class HandshakeDistance { kHandToRoot, kAgentRoots };
enum class HandshakeActive { kPerformerHand, kPartnerHand };
enum class HandshakeStability { kWhole, kRollingAll, kRollingAny };
enum class StabilityFrames { kRaw, kValidated };
enum class HighFiveHeight { kClosestPair, kPerformerClosest, kPartnerClosest, kAnyHand, kPerformerAny, kOff };
enum class WavePlane { kXy, kLateralUp, kPca };
enum class WaveDisplacement { kStep, kBothSteps, kSinceLast, kNone };
enum class WaveAmplitude { kMaxAxis, kDiagonal, kDiameter, kHorizontal };
enum class WaveHeight { kAnyHandMax, kActiveMax, kActiveMean, kActiveMedian };
enum class MotionFrame { kWorld, kRoot };
enum class BendFrames { kCount, kConsecutive };
enum class BendDirection { kAny, kForward };
enum class FlyKissOrder { kWhole, kAfterClosest, kAfterFirstClose };
enum class FlyKissDirection { kSpace, kHorizontal };

struct DetectorReadings {
  HugSingle hug_single = HugSingle::kAnyHand;
  HugShoulder hug_shoulder = HugShoulder::kBothHands;
  HandshakeDistance handshake_distance = HandshakeDistance::kHandToRoot;
  HandshakeActive handshake_active = HandshakeActive::kPerformerHand;
  HandshakeStability handshake_stability = HandshakeStability::kWhole;
  StabilityFrames handshake_stability_frames = StabilityFrames::kRaw;
  int handshake_ddof = 0;
  HighFiveHeight high_five_height = HighFiveHeight::kClosestPair;
  WavePlane wave_plane = WavePlane::kXy;
  WaveDisplacement wave_displacement = WaveDisplacement::kStep;
  WaveAmplitude wave_amplitude = WaveAmplitude::kMaxAxis;
  WaveHeight wave_height = WaveHeight::kAnyHandMax;
  MotionFrame wave_frame = MotionFrame::kWorld;
  BendFrames bend_frames = BendFrames::kCount;
  BendDirection bend_direction = BendDirection::kAny;
  FlyKissOrder fly_kiss_order = FlyKissOrder::kWhole;
  FlyKissDirection fly_kiss_dir = FlyKissDirection::kSpace;
  MotionFrame fly_kiss_frame = MotionFrame::kWorld;
};

// A phrase of one to three words that means the task; the language encoder compares stems and leaves function words
// out. No phrase belongs to two tasks.
struct TaskPhrase {
  std::string_view phrase;
  double weight;  // 1: says it outright; less: a hint that a plainer phrase overrules
};

// The signal that says how far an act is under way; larger is more. It proposes phases (docs/conventions.md, "Phases").
enum class ActSignal {
  kHandsTogether,  // nearness of the nearest hands of the two; the act is the contact
  kHandAtChest,    // nearness of a hand of either to the other's chest; likewise
  kHandsUp,        // rise of the higher hand of either; the act is the gesture
  kTrunksLean,     // inclination of the trunk of either; likewise
};
// Where a contact is reached for before it is there.
enum class OnsetSignal { kNone, kHandsCoverTheGap, kHandsUp };

struct PhaseSignal {
  ActSignal act = ActSignal::kHandsTogether;
  OnsetSignal onset = OnsetSignal::kNone;
};

struct ThresholdInfo {
  std::string_view name;  // of Table S11 without tau_, where the task is the supplement's
  double paper, strict;
  std::string_view unit;
  std::string_view meaning;
};

struct TaskDetector {
  std::span<const ThresholdInfo> thresholds;
  std::span<const DetectorFigure> figures;
  // The tracks that it looks at under these readings.
  Tracks (*tracks)(const Agent& performer, const Agent& partner, const DetectorReadings& readings);
  // Takes checked input: those tracks are there, equally long and finite, and every threshold is in the map.
  DetectorResult (*detect)(const Agent& performer, const Agent& partner, const Thresholds& tau,
                           const DetectorReadings& readings);
  // Sets the readings that come with the strict thresholds, leaving others as they are; null: none.
  void (*read_strictly)(DetectorReadings& readings) = nullptr;
};

// The parts that have to touch for an act to be an interaction.
enum class Touch { kNone, kHands, kArmsRoundTrunk };
// The sign that an act begins: a hand that rises, a trunk that leans; nothing where arms open on the way up.
enum class ActOnset { kNone, kHandRises, kTrunkLeans };

// The rule by which an act of the task is an interaction with the partner, beside the act (metrics/interaction.h).
struct InteractionRule {
  Touch touch = Touch::kNone;
  double touch_s = 0.0;      // a solid partner is touched for so long in all [s]
  double ghost_hands = 0.0;  // of a ghost: the nearest hands come so near [m]
  ActOnset onset = ActOnset::kNone;
  std::span<const std::string_view> includes = {};  // tasks whose acts belong to this one and are no others
};

struct TaskDefinition {
  std::string_view name;                          // as in tasks/list.cmake
  std::string_view prompt;                        // the command that stands for the task where no other is given
  std::span<const std::string_view> paraphrases;  // of it, that training uses and that measure the language encoder
  std::span<const TaskPhrase> phrases;            // by which the built-in encoder knows it
  PhaseSignal phases;
  synthesis::Act act;
  TaskDetector detector;
  const ActRule* rule = nullptr;  // of the set `act`; null: the strict thresholds stand for it
  InteractionRule interaction = {};
};

const TaskDefinition& definition_of(Task task);

}  // namespace duet
