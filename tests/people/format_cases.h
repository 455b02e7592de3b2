// The formats that hold two people as parameters of body models, each with files that are made in code, and the
// stand-ins that everybody has (examples/data/people).
#pragma once

#include <functional>
#include <numbers>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "duet/people/formats/inter/inter_x.h"
#include "duet/people/formats/people_formats.h"
#include "duet/people/people_format.h"
#include "tests/people/body_files.h"
#include "tests/people/body_model_files.h"

namespace duet::test {

struct FormatCase {
  std::string name;
  const PeopleFormat& (*format)();
  int body_joints;
  bool apart;  // needs an alignment
  bool shaped;
  double rate_hz;
  std::optional<Axis> up;
  // The files' contents by name, for two people.
  std::function<std::vector<std::pair<std::string, std::string>>(const BodyParameters&, const BodyParameters&)> files;
};

inline std::vector<FormatCase> format_cases() {
  using P = const BodyParameters&;
  using Contents = std::vector<std::pair<std::string, std::string>>;
  return {
      {"inter-x", inter_x_format, 21, false, true, 120.0, Axis::kPlusY,
       [](P a, P b) {
         return Contents{{"P1.npz", inter_x_npz(a).bytes()}, {"P2.npz", inter_x_npz(b, true).bytes()}};
       }},
      {"interhuman-raw", interhuman_raw_format, 21, false, true, 60.0, Axis::kPlusZ,
       [](P a, P b) {
         return Contents{{"7.pkl", interhuman_pickle(a, b)}};
       }},
      {"amass", amass_format, 21, true, true, 120.0, Axis::kPlusZ,
       [](P a, P b) {
         return Contents{{"a_poses.npz", amass_poses_npz(a).bytes()}, {"b_stageii.npz", amass_stageii_npz(b).bytes()}};
       }},
      {"motion-x", motion_x_format, 21, true, true, 30.0, std::nullopt,
       [](P a, P b) {
         return Contents{{"a.npy", motion_x_npy(a)}, {"b.npy", motion_x_npy(b)}};
       }},
      {"phuma-human", phuma_human_format, 21, true, false, 30.0, Axis::kPlusY,
       [](P a, P b) {
         return Contents{{"a.npy", phuma_npy(a)}, {"b.npy", phuma_npy(b)}};
       }},
      {"gvhmr", gvhmr_format, 21, true, true, 30.0, Axis::kPlusY,
       [](P a, P b) {
         return Contents{{"a.pt", gvhmr_pt(a)}, {"b.pt", gvhmr_pt(b)}};
       }},
      {"wham", wham_format, 23, true, true, 30.0, Axis::kPlusY,
       [](P a, P b) {
         return Contents{{"wham_output.pkl", wham_pkl({{0, 0, a}, {3, 0, b}})}};
       }},
      {"4d-humans", four_d_humans_format, 23, true, true, 30.0, std::nullopt,
       [](P a, P b) {
         return Contents{{"video.pkl", phalp_pkl({{1, 0, a}, {2, 0, b}}, a.frames)}};
       }},
      {"inter-x-h5", inter_x_h5_format, 21, false, false, 30.0, Axis::kPlusY, [](P a, P b) {
         return Contents{{"train.h5", inter_x_h5("G001T000A001R000", a, b)}};
       }}};
}

constexpr int kStandInFrames = 7, kStandInFramesOfMatrices = 4;  // a few kB each

// Two people who stand 0.8 m apart, face each other and hold their right hands out, in a format's own axes.
inline std::pair<BodyParameters, BodyParameters> stand_in_people(const FormatCase& which) {
  double tilt = 0.0;  // of the model's y in the file, about x
  if (which.up == Axis::kPlusZ) tilt = 0.5 * std::numbers::pi;
  if (which.name == "4d-humans") tilt = std::numbers::pi;  // the camera's y points down
  const Eigen::Quaterniond U(Eigen::AngleAxisd(tilt, Eigen::Vector3d::UnitX()));
  const Eigen::Quaterniond ahead(Eigen::AngleAxisd(0.5 * std::numbers::pi, Eigen::Vector3d::UnitY()));
  const int frames = which.name == "4d-humans" ? kStandInFramesOfMatrices : kStandInFrames;
  return {standing_parameters(frames, U * ahead, U * Eigen::Vector3d(-0.4, 0.9, 0.1), which.body_joints),
          standing_parameters(frames, U * ahead.conjugate(), U * Eigen::Vector3d(0.4, 0.9, 0.1), which.body_joints)};
}

inline std::string stand_in_folder(const FormatCase& which) {
  const std::string folder = DUET_SOURCE_DIR "/examples/data/people/" + which.name;
  return which.name == "inter-x" ? folder + "/G001T000A001R000" : folder;
}

}  // namespace duet::test
