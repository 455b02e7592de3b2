// From body-model parameters of two people to their joints: what all readers of such files end in.
#pragma once

#include <array>
#include <span>
#include <string>
#include <vector>

#include "duet/motion/people/raw_people.h"
#include "duet/people/bodies/body_model.h"
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

// The joints (T, 24) of a motion by its model [m]; its rotations become global.
PointTracks pose_motion(BodyMotion& motion, const BodyModel& model);

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

// Two people who were recorded apart, put into one world. Person A stays; person B is turned about the vertical and
// moved as a rigid body, the same in every frame. The result is an estimate, and its source says so.
//
// floor: both stand on one floor (the 5th percentile of each one's lower toe). Level, they stay where the files have
// them if their pelvises come within 0.2 to 2.5 m of one another; else B faces A at 0.8 m in the middle frame.
// contact: the same floor; then of all frames and pairs of hands the one is taken where both reach furthest forward at
// the same height. There B faces A, and is moved so that these two hands meet (mean of 0.1 s before and after). Meant
// for handshakes and high fives; hands more than 0.3 m apart in height are refused.

// `raw` has SMPL-24 joints. Adds evidence, and source["provenance"] = "estimated shared frame". The vertical is
// options.up, else raw.up, else the axis along which heads lie above ankles. Throws InputError naming the file.
void align_people(RawPeople& raw, const PeopleOptions& options);

}  // namespace duet
