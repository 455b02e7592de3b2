#include "metrics/detector.h"

#include <fmt/format.h>

#include <cmath>
#include <stdexcept>

#include "core/names.h"
#include "core/require.h"
#include "metrics/detector_catalogue.h"
#include "metrics/task_detectors.h"

namespace duet {
namespace {

struct NamedTrack {
  const char* name;
  const Eigen::Matrix3Xd* track;
};

// A direction towards the partner is taken from his root, without one from the performer's shoulders.
void add_direction(const Agent& performer, const Agent& partner, std::vector<NamedTrack>& tracks) {
  if (partner.root.cols() > 0) {
    tracks.push_back({"partner.root", &partner.root});
  } else {
    tracks.push_back({"performer.lshoulder", &performer.lshoulder});
    tracks.push_back({"performer.rshoulder", &performer.rshoulder});
  }
}

// The tracks that a task looks at under these readings.
std::vector<NamedTrack> needed_tracks(Task task, const Agent& performer, const Agent& partner,
                                      const DetectorReadings& readings) {
  std::vector<NamedTrack> tracks;
  if (task != Task::kBend) tracks = {{"performer.lhand", &performer.lhand}, {"performer.rhand", &performer.rhand}};
  if (task == Task::kBend || task == Task::kFlyKiss) tracks.push_back({"performer.head", &performer.head});
  if (task != Task::kHug) tracks.push_back({"performer.root", &performer.root});

  if (task == Task::kHug) {
    tracks.push_back({"partner.torso", &partner.torso});
    if (readings.hug_shoulder == HugShoulder::kBothHands || readings.hug_shoulder == HugShoulder::kAnyHand) {
      tracks.push_back({"partner.lshoulder", &partner.lshoulder});
      tracks.push_back({"partner.rshoulder", &partner.rshoulder});
    }
  }
  if (task == Task::kHandshake || task == Task::kHighFive) {
    tracks.push_back({"partner.lhand", &partner.lhand});
    tracks.push_back({"partner.rhand", &partner.rhand});
  }
  if (task == Task::kFlyKiss ||
      (task == Task::kHandshake && readings.handshake_distance == HandshakeDistance::kAgentRoots))
    tracks.push_back({"partner.root", &partner.root});
  if ((task == Task::kWave && readings.wave_plane == WavePlane::kLateralUp) ||
      (task == Task::kBend && readings.bend_direction == BendDirection::kForward))
    add_direction(performer, partner, tracks);
  return tracks;
}

void check_tracks(Task task, const std::vector<NamedTrack>& tracks) {
  const Eigen::Index frames = tracks.front().track->cols();
  for (const auto& [name, track] : tracks) {
    require(track->cols() > 0, fmt::format("{} detector: the track {} is needed and empty", to_string(task), name));
    require(track->cols() == frames, fmt::format("{} detector: the track {} has {} frames, but {} has {}",
                                                 to_string(task), name, track->cols(), tracks.front().name, frames));
    if (track->allFinite()) continue;
    for (Eigen::Index t = 0; t < frames; ++t)
      require(track->col(t).allFinite(),
              fmt::format("{} detector: the track {} is not finite at frame {}", to_string(task), name, t));
  }
}

// The task's thresholds with those given in the place of the printed ones.
Thresholds completed(Task task, const Thresholds& given) {
  Thresholds complete = thresholds(task);
  for (const auto& [name, value] : given) {
    const auto known = complete.find(name);
    if (known == complete.end()) {
      std::vector<std::string> names;
      for (const auto& entry : complete) names.push_back(entry.first);
      throw std::invalid_argument(unknown_name_message(fmt::format("threshold of {}", to_string(task)), name, names));
    }
    require(std::isfinite(value), fmt::format("threshold {} of {} is not finite", name, to_string(task)));
    known->second = value;
  }
  return complete;
}

}  // namespace

std::string_view to_string(DetectorVersion version) { return version == DetectorVersion::kPaper ? "paper" : "robot"; }
std::string_view to_string(ThresholdSet set) { return set == ThresholdSet::kPaper ? "paper" : "strict"; }

Thresholds thresholds(Task task, ThresholdSet set) {
  Thresholds tau;
  for (const ThresholdInfo& info : threshold_catalogue())
    if (info.task == task) tau[std::string(info.name)] = set == ThresholdSet::kStrict ? info.strict : info.paper;
  require(!tau.empty(), "thresholds: not a task");
  return tau;
}

DetectorReadings strict_readings(DetectorReadings readings) {
  readings.bend_direction = BendDirection::kForward;
  readings.fly_kiss_order = FlyKissOrder::kAfterClosest;
  return readings;
}

DetectorResult detect_performer(Task task, const Agent& performer, const Agent& partner, const Thresholds& thresholds,
                                const DetectorReadings& readings) {
  check_tracks(task, needed_tracks(task, performer, partner, readings));
  const Thresholds tau = completed(task, thresholds);
  switch (task) {
    case Task::kHug:
      return detect_hug(performer, partner, tau, readings);
    case Task::kHandshake:
      return detect_handshake(performer, partner, tau, readings);
    case Task::kHighFive:
      return detect_high_five(performer, partner, tau, readings);
    case Task::kWave:
      return detect_wave(performer, partner, tau, readings);
    case Task::kBend:
      return detect_bend(performer, partner, tau, readings);
    case Task::kFlyKiss:
      return detect_fly_kiss(performer, partner, tau, readings);
  }
  throw std::invalid_argument("detector: not a task");
}

DetectorResult detect(Task task, const Agent& human, const Agent& robot, DetectorVersion version, ThresholdSet set,
                      DetectorReadings readings) {
  if (set == ThresholdSet::kStrict) readings = strict_readings(readings);
  const bool paper = version == DetectorVersion::kPaper;
  return detect_performer(task, paper ? human : robot, paper ? robot : human, thresholds(task, set), readings);
}

}  // namespace duet
