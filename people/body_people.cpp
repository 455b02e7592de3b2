#include "duet/people/body_people.h"

#include <fmt/format.h>

#include <algorithm>
#include <filesystem>
#include <utility>

#include "duet/core/require.h"
#include "duet/core/text.h"
#include "duet/people/alignment.h"
#include "duet/people/bodies/body_kinematics.h"
#include "duet/people/bodies/body_model.h"

namespace duet {
namespace {

void check_clock(const std::array<BodyMotion, 2>& people) {
  const auto& [a, b] = people;
  if (a.frames() != b.frames())
    throw InputError(fmt::format("'{}' has {} frames and '{}' {}: expected two people of the same length",
                                 shown(a.file), a.frames(), shown(b.file), b.frames()));
  if (a.frames() < 2)
    throw InputError(fmt::format("'{}': expected at least 2 frames, found {}", shown(a.file), a.frames()));
}

void pose(RawPeople& raw, std::size_t who, BodyMotion motion, const BodyModel& model) {
  const RestJoints rest = rest_joints(model, motion.betas);
  raw.joints[who] = PointTracks(motion.frames(), kSmplJoints);
  for (int t = 0; t < motion.frames(); ++t)
    pose_body(rest, motion.translation[t],
              std::span(motion.local).subspan(static_cast<std::size_t>(t) * kSmplJoints, kSmplJoints),
              raw.joints[who].frame(t));
  raw.rotations[who] = std::move(motion.local);
}

std::string name_of(const std::string& path) { return std::filesystem::path(path).filename().string(); }

}  // namespace

BodyMotion body_motion(const std::string& file, const NumberTable& root, const NumberTable& body,
                       const NumberTable& translation) {
  const int frames = checked_rows(root, {3}, "(T, 3)").rows();
  checked_rows(body, {63, 69}, "(T, 63), (T, 21, 3), (T, 69) or (T, 23, 3)", frames);
  checked_rows(translation, {3}, "(T, 3)", frames);
  const std::size_t joints = body.values.size() / static_cast<std::size_t>(frames) / 3;
  BodyMotion motion{.file = file};
  motion.local.assign(static_cast<std::size_t>(frames) * kSmplJoints, Eigen::Quaterniond::Identity());
  motion.translation.resize(static_cast<std::size_t>(frames));
  for (std::size_t t = 0; t < motion.translation.size(); ++t) {
    motion.translation[t] = Eigen::Map<const Eigen::Vector3d>(&translation.values[3 * t]);
    Eigen::Quaterniond* local = &motion.local[t * kSmplJoints];
    local[kPelvis] = rotation_of_vector(Eigen::Map<const Eigen::Vector3d>(&root.values[3 * t]));
    const double* turns = &body.values[3 * joints * t];
    for (std::size_t j = 0; j < joints; ++j)
      local[j + 1] = rotation_of_vector(Eigen::Map<const Eigen::Vector3d>(turns + 3 * j));
  }
  return motion;
}

std::vector<double> mean_betas(const NumberTable& betas) {
  const std::size_t rows = betas.shape.size() < 2 ? 1 : std::max<std::size_t>(betas.shape.front(), 1);
  const std::size_t count = betas.values.size() / rows;
  std::vector<double> mean(count, 0.0);
  for (std::size_t i = 0; i < rows * count; ++i) mean[i % count] += betas.values[i] / static_cast<double>(rows);
  return mean;
}

void add_people(RawPeople& raw, BodyPeople people, const PeopleOptions& options) {
  check_clock(people.people);
  auto& [a, b] = people.people;
  if (people.apart && options.align == Alignment::kNone)
    throw InputError(
        fmt::format("'{}', '{}': each person was recorded in a world of its own: state how they come into "
                    "one (align floor, align contact)",
                    shown(a.file), shown(b.file)));
  const BodyModel model = options.body_model.empty() ? average_body() : load_body_model(options.body_model);
  raw.layout = &joint_layout("smpl-24");
  raw.source["format"] = people.format;
  raw.source["file_a"] = name_of(a.file);
  raw.source["file_b"] = name_of(b.file);
  raw.source["body_model"] = model.kind.empty() ? "none: average skeleton" : model.kind;
  if (!people.licence.empty()) raw.source["licence"] = people.licence;
  raw.evidence.push_back(model.note);
  pose(raw, 0, std::move(a), model);
  pose(raw, 1, std::move(b), model);
  if (people.apart) align_people(raw, options);
}

}  // namespace duet
