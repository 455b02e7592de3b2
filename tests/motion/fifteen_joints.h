// People of 15 Kinect joints as SMPL-24, by the table of docs/file-formats.md ("People of fewer joints"), and the
// two-person recordings of the shared data, levelled and put on the floor.
#pragma once

#include <algorithm>
#include <filesystem>
#include <map>
#include <string>
#include <vector>

#include "duet/archives/npy/npz.h"
#include "duet/motion/interaction_clip.h"

namespace duet::test {

using Points = std::map<std::string, Eigen::Vector3d>;

inline void put_side(const Points& p, const std::string& letter, int left_or_right, const Eigen::Vector3d& middle,
                     const Eigen::Vector3d& ahead, PointTracks::Frame to) {
  const auto smpl = [&](int left, int right) { return left_or_right == 0 ? left : right; };
  const auto at = [&](const char* name) { return p.at(letter + name); };
  to.col(smpl(kLeftHip, kRightHip)) = at("hip");
  to.col(smpl(kLeftKnee, kRightKnee)) = at("knee");
  to.col(smpl(kLeftAnkle, kRightAnkle)) = at("foot");
  to.col(smpl(kLeftToe, kRightToe)) = at("foot") + 0.12 * ahead - Eigen::Vector3d(0, 0, 0.05);
  const Eigen::Vector3d collar_height = middle;
  to.col(smpl(kLeftCollar, kRightCollar)) = collar_height + 0.38 * (at("shoulder") - p.at("neck"));
  to.col(smpl(kLeftShoulder, kRightShoulder)) = at("shoulder");
  to.col(smpl(kLeftElbow, kRightElbow)) = at("elbow");
  to.col(smpl(kLeftWrist, kRightWrist)) = at("hand") + 0.08 * (at("elbow") - at("hand")).normalized();
  to.col(smpl(kLeftHand, kRightHand)) = at("hand");
}

inline void put_person(const Points& p, PointTracks::Frame to) {
  const Eigen::Vector3d hips = 0.5 * (p.at("lhip") + p.at("rhip")), neck = p.at("neck");
  const Eigen::Vector3d pelvis = hips + 0.05 * (neck - hips).normalized();
  const auto spine = [&](double part) -> Eigen::Vector3d { return pelvis + part * (neck - pelvis); };
  const Eigen::Vector3d left = p.at("lhip") - p.at("rhip") + p.at("lshoulder") - p.at("rshoulder");
  const Eigen::Vector3d ahead = Eigen::Vector3d(left.y(), -left.x(), 0.0).normalized();
  to.col(kPelvis) = pelvis;
  to.col(kSpine1) = spine(0.21);
  to.col(kSpine2) = spine(0.48);
  to.col(kSpine3) = spine(0.60);
  to.col(kNeck) = neck;
  to.col(kHead) = p.at("head");
  put_side(p, "l", 0, spine(0.81), ahead, to);
  put_side(p, "r", 1, spine(0.81), ahead, to);
}

// Points of a (T, 2, 15, 3) recording.
struct FifteenJoints {
  std::vector<std::string> names;
  std::vector<double> xyz;
  double rate_hz = 15.0;

  explicit FifteenJoints(const std::string& path) {
    const Npz npz = Npz::load(path);
    names = npz.strings("joints", {15});
    xyz = npz.numbers("positions", {-1, 2, 15, 3});
    rate_hz = npz.number("rate_hz");
  }
  [[nodiscard]] int frames() const { return static_cast<int>(xyz.size() / 90); }
  [[nodiscard]] Points at(int frame, int person, const Eigen::Quaterniond& R = Eigen::Quaterniond::Identity()) const {
    Points points;
    for (std::size_t j = 0; j < 15; ++j)
      points[names[j]] = R * Eigen::Map<const Eigen::Vector3d>(&xyz[((2 * frame + person) * 15 + j) * 3]);
    return points;
  }
};

inline std::vector<std::string> sbu_files(const std::string& folder) {
  std::vector<std::string> files;
  for (const auto& entry : std::filesystem::directory_iterator(folder))
    if (entry.path().extension() == ".npz") files.push_back(entry.path().string());
  std::sort(files.begin(), files.end());
  return files;
}

// The camera's tilt: from the mean direction head above feet over all recordings to z.
inline Eigen::Quaterniond camera_tilt(const std::vector<FifteenJoints>& recordings) {
  Eigen::Vector3d up = Eigen::Vector3d::Zero();
  for (const FifteenJoints& recording : recordings)
    for (int t = 0; t < recording.frames(); ++t)
      for (const int who : {0, 1}) {
        const Points p = recording.at(t, who);
        up += (p.at("head") - 0.5 * (p.at("lfoot") + p.at("rfoot"))).normalized();
      }
  return Eigen::Quaterniond::FromTwoVectors(up, Eigen::Vector3d::UnitZ());
}

// Turned by R and moved so that the median of the lower ankle is 7 cm over the floor.
inline InteractionClip clip_of(const FifteenJoints& recording, const Eigen::Quaterniond& R, const std::string& id,
                               Task task) {
  InteractionClip clip;
  clip.id = id;
  clip.task = task;
  std::vector<double> ankles;
  for (const auto& [who, motion] : {std::pair<int, HumanMotion*>{0, &clip.a}, {1, &clip.b}}) {
    *motion = {.rate_hz = recording.rate_hz, .joints = PointTracks(recording.frames(), kSmplJoints), .rotations = {}};
    for (int t = 0; t < recording.frames(); ++t) {
      put_person(recording.at(t, who, R), motion->joints.frame(t));
      ankles.push_back(std::min(motion->joints.at(t, kLeftAnkle).z(), motion->joints.at(t, kRightAnkle).z()));
    }
  }
  std::nth_element(ankles.begin(), ankles.begin() + ankles.size() / 2, ankles.end());
  const Eigen::Vector3d lift(0.0, 0.0, 0.07 - ankles[ankles.size() / 2]);
  for (HumanMotion* motion : {&clip.a, &clip.b})
    for (int t = 0; t < recording.frames(); ++t) motion->joints.frame(t).colwise() += lift;
  clip.phases = {.act_begin = 0, .act_end = recording.frames()};
  return clip;
}

}  // namespace duet::test
