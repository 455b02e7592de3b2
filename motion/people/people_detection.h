// Facts that the positions of two people tell: unit, up axis, mirror, the tilt of the floor and its height. Each
// finding is a value and a sentence for the user; a fact that cannot be told is refused with the option that settles
// it. Pure functions.
#pragma once

#include <array>
#include <string>
#include <vector>

#include "duet/motion/people/raw_people.h"

namespace duet {

template <typename T>
struct PeopleFinding {
  T value;
  std::string sentence;
};

// How points of the file become points of W: p_W = M p_F + p, M a rotation times the unit, with a reflection where the
// file is mirrored.
struct WorldOfFile {
  Eigen::Matrix3d M = Eigen::Matrix3d::Identity();
  Eigen::Vector3d p = Eigen::Vector3d::Zero();
};

using SampledPeople = std::array<std::vector<SmplFrame>, 2>;

// Some frames of both people, spread evenly over the recording; all where there are few.
class PeopleSamples {
 public:
  // `first`: frames before it are left out.
  PeopleSamples(const RawPeople& people, int first);

  // The samples' SMPL joints through a world; `offsets` as in make_smpl.
  [[nodiscard]] SampledPeople in(const WorldOfFile& world, bool offsets) const;
  // Where noses point; empty where the layout has none.
  [[nodiscard]] std::array<std::vector<Eigen::Vector3d>, 2> faces_in(const WorldOfFile& world) const;

 private:
  const RawPeople& people_;
  std::vector<int> frames_;
};

// From the mean length of the bones from head to ankle: a person's in one of the units of motion/plausibility.h.
PeopleFinding<double> find_unit(const RawPeople& people, const SampledPeople& raw, const PeopleOptions& options);

// From the mean direction head above ankles, with its sign.
PeopleFinding<Axis> find_up(const RawPeople& people, const SampledPeople& raw, const PeopleOptions& options);
// From the mean direction head above `parts` ("ankles").
PeopleFinding<Axis> find_up(const RawPeople& people, const Eigen::Vector3d& mean, std::string_view parts,
                            const PeopleOptions& options);

// The rotation that takes an axis to z.
Eigen::Matrix3d rotation_of(Axis up);
std::string_view to_string(Axis axis);  // "+y"
// "y", "+y", "-z". Throws std::invalid_argument.
Axis parse_axis(std::string_view text);

// In W: which way toes, faces and knees point against what hips and shoulders call left and right.
PeopleFinding<bool> find_mirror(const SampledPeople& people, const std::array<std::vector<Eigen::Vector3d>, 2>& faces,
                                bool has_toes, const PeopleOptions& options);

// In W: the rotation that makes the floor level. Its normal is the one that agrees best with the places of the feet and
// with how the two stand upright.
PeopleFinding<Eigen::Matrix3d> find_level(const RawPeople& raw, const SampledPeople& people,
                                          const PeopleOptions& options);

// In W, level: what is added to heights. The median of the lower toe lies 2 cm over a floor, as SMPL's does.
PeopleFinding<double> find_floor(const SampledPeople& people, const PeopleOptions& options);

}  // namespace duet
