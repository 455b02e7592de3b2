// The named readings of what the supplement leaves open in its detectors (docs/deviations.md): the first value of each
// is the default. Their names in text are in metrics/readings.cpp.
#pragma once

namespace duet {

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

}  // namespace duet
