// From body-model parameters of two people to their joints: what all readers of such files end in.
#pragma once

#include <array>
#include <span>
#include <string>
#include <vector>

#include "duet/people/bodies/number_table.h"
#include "duet/people/people_format.h"

namespace duet {

// One person as a file of parameters holds it.
struct BodyMotion {
  std::string file;  // for messages
  std::vector<Eigen::Quaterniond> local =
      {};  // T * 24, each against its parent's; the identity where the file has none
  std::vector<Eigen::Vector3d> translation = {};
  std::vector<double> betas = {};  // of the whole motion; empty: mean shape

  [[nodiscard]] int frames() const { return static_cast<int>(translation.size()); }
};

// Root (T, 3), body (T, 63) of 21 joints or (T, 69) of 23, translation (T, 3), all of one length: axis-angle [rad],
// [m]. Any shape with rows of those sizes. Throws InputError naming the table.
BodyMotion body_motion(const std::string& file, const NumberTable& root, const NumberTable& body,
                       const NumberTable& translation);

// The mean over rows where there are several: a person does not change shape.
std::vector<double> mean_betas(const NumberTable& betas);

struct BodyPeople {
  std::string_view format;  // for `source`
  std::string_view licence;
  std::array<BodyMotion, 2> people;
  bool apart = false;  // each in a world of its own: PeopleOptions::align decides, and is refused where it says nothing
};

// Fills layout, joints, rotations, evidence and source of `raw`, whose id, name, rate, up axis, task and reactor are
// the caller's. Throws InputError: two lengths, fewer than 2 frames, no alignment said, what load_body_model says.
void add_people(RawPeople& raw, BodyPeople people, const PeopleOptions& options);

}  // namespace duet
