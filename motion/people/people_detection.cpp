#include "duet/motion/people/people_detection.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <numbers>

#include "duet/core/numbers.h"
#include "duet/core/require.h"
#include "duet/motion/plausibility.h"

namespace duet {
namespace {

constexpr int kMostSamples = 240;  // findings are medians and means; more frames change no digit that is printed
constexpr double kDegree = std::numbers::pi / 180.0;
// Nine of ten recordings of people who stand have their mean upright within 9 degrees of vertical (282 of SBU, levelled
// by their common tilt): a person's spread is about 6. A Kinect's feet are known to 3 cm, three times in a recording
// with the same error.
constexpr double kUprightSpread = 6.0 * kDegree, kFootSpread = 0.05;  // [rad, m]
constexpr double kLeastTilt = 4.0 * kDegree;                          // less is what people do, and is left
constexpr double kToeHeight = 0.02;      // of SMPL's toe joint over the floor, standing [m]
constexpr double kFloorKept = 0.05;      // a floor as near to 0 as this is the file's own [m]
constexpr double kMirrored = -0.3;       // mean cosine, or share of a bent knee, pointing backwards
constexpr double kBentKnee = 0.03;       // a knee is bent where it is off the line hip-ankle by this [m]
constexpr double kLeastLevelToe = 0.02;  // [m]

constexpr std::array<std::pair<SmplJoint, SmplJoint>, 2> kFeet = {{{kLeftAnkle, kLeftToe}, {kRightAnkle, kRightToe}}};

double head_to_ankles(const SmplFrame& p) {
  const auto bones_up = [&](int joint) {
    double length = 0.0;
    for (; kSmplParents[joint] >= 0; joint = kSmplParents[joint])
      length += (p.col(joint) - p.col(kSmplParents[joint])).norm();
    return length;
  };
  return bones_up(kHead) + 0.5 * (bones_up(kLeftAnkle) + bones_up(kRightAnkle));
}

Eigen::Vector3d upright(const SmplFrame& p) {
  return (p.col(kHead) - 0.5 * (p.col(kLeftAnkle) + p.col(kRightAnkle))).normalized();
}

Eigen::Vector3d mean_upright_of(const SampledPeople& people) {
  Eigen::Vector3d sum = Eigen::Vector3d::Zero();
  for (const auto& person : people)
    for (const SmplFrame& p : person) sum += upright(p);
  return sum / static_cast<double>(people[0].size() + people[1].size());
}

template <typename Value>
double median_over(const std::vector<SmplFrame>& frames, std::size_t begin, std::size_t end, Value&& value) {
  std::vector<double> values;
  for (std::size_t i = begin; i < end; ++i) values.push_back(value(frames[i]));
  return quantile(std::move(values), 0.5);
}

std::string direction_text(const Eigen::Vector3d& v) {
  return fmt::format("({:.2f}, {:.2f}, {:.2f})", v.x(), v.y(), v.z());
}

// Level and unit; none where hips and shoulders have no level line.
std::optional<Eigen::Vector2d> ahead_of(const SmplFrame& p) {
  const Eigen::Vector2d left =
      (p.col(kLeftHip) - p.col(kRightHip) + p.col(kLeftShoulder) - p.col(kRightShoulder)).head<2>();
  if (!(left.norm() > 1e-3)) return std::nullopt;
  return Eigen::Vector2d(left.y(), -left.x()) / left.norm();
}

// Mean of what is known.
struct Mean {
  double sum = 0.0;
  int count = 0;
  void add(double value) { sum += value, ++count; }
  [[nodiscard]] double value() const { return count > 0 ? sum / count : 0.0; }
};

// Cosines with the heading, over both people.
struct Pointing {
  Mean toes, knees, face, partner;
};

void add_frame(const SmplFrame& p, const SmplFrame& other, bool has_toes, Pointing& pointing) {
  const std::optional<Eigen::Vector2d> ahead = ahead_of(p);
  if (!ahead) return;
  for (const auto& [ankle, toe] : kFeet) {
    const Eigen::Vector2d foot = (p.col(toe) - p.col(ankle)).head<2>();
    if (has_toes && foot.norm() > kLeastLevelToe) pointing.toes.add(foot.dot(*ahead) / foot.norm());
  }
  for (const auto& [hip, knee, ankle] :
       {std::array{kLeftHip, kLeftKnee, kLeftAnkle}, std::array{kRightHip, kRightKnee, kRightAnkle}}) {
    const Eigen::Vector2d bend = (p.col(knee) - 0.5 * (p.col(hip) + p.col(ankle))).head<2>();
    if (bend.norm() > kBentKnee) pointing.knees.add(bend.dot(*ahead) / bend.norm());
  }
  const Eigen::Vector2d way = (other.col(kPelvis) - p.col(kPelvis)).head<2>();
  if (way.norm() > 1e-3) pointing.partner.add(way.dot(*ahead) / way.norm());
}

std::string mirror_sentence(bool mirrored, const Pointing& pointing) {
  std::string figures;
  const auto put = [&](const char* what, const Mean& mean) {
    if (mean.count > 0) figures += fmt::format("{}{} {:+.2f}", figures.empty() ? "" : ", ", what, mean.value());
  };
  put("toes", pointing.toes);
  put("faces", pointing.face);
  put("knees", pointing.knees);
  put("the partner", pointing.partner);
  return fmt::format("mirror: {} (cosine with where hips and shoulders face: {})",
                     mirrored ? "left and right are exchanged: the world is reflected, the names stay" : "no",
                     figures.empty() ? "not known" : figures);
}

// Toes and faces decide alone. Knees that are hardly bent say little: they need a partner whom nobody faces beside them
// (of 282 recordings of SBU knees alone would call one mirrored).
bool says_mirrored(const Pointing& pointing) {
  const double toes = 3.0 * pointing.toes.sum + 3.0 * pointing.face.sum;
  const double weight = 3.0 * (pointing.toes.count + pointing.face.count);
  if (weight > 0.0) return toes / weight < kMirrored;
  return pointing.knees.count > 0 && pointing.knees.value() < kMirrored && pointing.partner.value() < 0.0;
}

// Weighted least squares for the floor z = c + g . (x, y): heights of feet, and uprights that stand along (-g, 1).
class FloorFit {
 public:
  void add_foot(const Eigen::Vector3d& p) {
    const Eigen::Vector3d row(1.0, p.x(), p.y());
    add(row, p.z(), kFootSpread);
  }
  void add_upright(const Eigen::Vector3d& up) {
    add({0.0, 1.0, 0.0}, -up.x() / up.z(), kUprightSpread);
    add({0.0, 0.0, 1.0}, -up.y() / up.z(), kUprightSpread);
  }
  [[nodiscard]] Eigen::Vector3d normal() const {
    const Eigen::Vector3d solution = A_.ldlt().solve(b_);
    return Eigen::Vector3d(-solution[1], -solution[2], 1.0).normalized();
  }

 private:
  void add(const Eigen::Vector3d& row, double value, double spread) {
    A_ += row * row.transpose() / (spread * spread);
    b_ += row * value / (spread * spread);
  }
  Eigen::Matrix3d A_ = Eigen::Matrix3d::Zero();
  Eigen::Vector3d b_ = Eigen::Vector3d::Zero();
};

// The median of each foot over each third of the recording, and of each person's upright.
Eigen::Vector3d floor_normal(const SampledPeople& people) {
  FloorFit fit;
  for (const auto& person : people) {
    const std::size_t n = person.size();
    for (std::size_t third = 0; third < 3; ++third) {
      const std::size_t begin = third * n / 3, end = std::max((third + 1) * n / 3, begin + 1);
      if (begin >= n || end > n) continue;
      for (const auto& [ankle, toe] : kFeet) {
        Eigen::Vector3d foot;
        for (int axis = 0; axis < 3; ++axis)
          foot[axis] = median_over(person, begin, end, [&, j = toe](const SmplFrame& p) { return p(axis, j); });
        fit.add_foot(foot);
      }
    }
    Eigen::Vector3d up;
    for (int axis = 0; axis < 3; ++axis)
      up[axis] = median_over(person, 0, n, [&](const SmplFrame& p) { return upright(p)[axis]; });
    if (up.z() > 0.5) fit.add_upright(up);
  }
  return fit.normal();
}

}  // namespace

PeopleSamples::PeopleSamples(const RawPeople& people, int first) : people_(people) {
  const int frames = people.joints[0].frames() - first, count = std::min(frames, kMostSamples);
  for (int i = 0; i < count; ++i)
    frames_.push_back(first + static_cast<int>(static_cast<std::int64_t>(i) * frames / count));
}

SampledPeople PeopleSamples::in(const WorldOfFile& world, bool offsets) const {
  SampledPeople people;
  PointTracks moved(1, people_.joints[0].points());
  for (const std::size_t who : {0U, 1U})
    for (const int t : frames_) {
      moved.frame(0) = (world.M * people_.joints[who].frame(t)).colwise() + world.p;
      const PointTracks& columns = moved;
      make_smpl(*people_.layout, columns.frame(0), offsets, people[who].emplace_back());
    }
  return people;
}

std::array<std::vector<Eigen::Vector3d>, 2> PeopleSamples::faces_in(const WorldOfFile& world) const {
  std::array<std::vector<Eigen::Vector3d>, 2> faces;
  if (people_.layout->face.empty()) return faces;
  for (const std::size_t who : {0U, 1U})
    for (const int t : frames_) {
      Eigen::Vector3d face = Eigen::Vector3d::Zero();
      for (const JointRecipe::Part& part : people_.layout->face)
        face += part.weight * people_.joints[who].at(t, part.column);
      faces[who].emplace_back(world.M * face);
    }
  return faces;
}

PeopleFinding<double> find_unit(const RawPeople& people, const SampledPeople& raw, const PeopleOptions& options) {
  double mean = 0.0;
  for (const auto& person : raw) mean += 0.5 * median_over(person, 0, person.size(), head_to_ankles);
  if (options.metres_per_unit) {
    const double metres = *options.metres_per_unit;
    require(std::isfinite(metres) && metres > 0.0, "expected a positive unit of length, found {} m", metres);
    return {metres, fmt::format("unit: {} m (as told; head to ankle {:.2f} m)", metres, metres * mean)};
  }
  if (people.metres_per_unit)
    return {*people.metres_per_unit, fmt::format("unit: {} m (as the format has it; head to ankle {:.2f} m)",
                                                 *people.metres_per_unit, *people.metres_per_unit * mean)};
  for (const LengthUnit& unit : kLengthUnits)
    if (const double length = mean * unit.metres; kShortestPerson <= length && length <= kTallestPerson)
      return {unit.metres, fmt::format("unit: {} m, {} (head to ankle {:.4g} units = {:.2f} m)", unit.metres, unit.name,
                                       mean, length)};
  throw InputError(fmt::format(
      "'{}': cannot tell the unit of length: the bones from head to ankle measure {:.4g} units, which is {} "
      "to {} m in none of metre, CMU unit, inch, centimetre, millimetre; state the metres per unit",
      excerpt(people.name), mean, kShortestPerson, kTallestPerson));
}

PeopleFinding<Axis> find_up(const RawPeople& people, const SampledPeople& raw, const PeopleOptions& options) {
  return find_up(people, mean_upright_of(raw), "ankles", options);
}

PeopleFinding<Axis> find_up(const RawPeople& people, const Eigen::Vector3d& mean, std::string_view parts,
                            const PeopleOptions& options) {
  const std::string figures = fmt::format("heads are above {} along {}", parts, direction_text(mean));
  if (options.up) return {*options.up, fmt::format("up axis: {} (as told; {})", to_string(*options.up), figures)};
  if (people.up)
    return {*people.up, fmt::format("up axis: {} (as the format has it; {})", to_string(*people.up), figures)};
  for (int axis = 0; axis < 3; ++axis)
    if (std::abs(mean[axis]) >= kUprightCosine) {
      const auto up = static_cast<Axis>(2 * axis + (mean[axis] < 0.0 ? 1 : 0));
      return {up, fmt::format("up axis: {} ({})", to_string(up), figures)};
    }
  throw InputError(fmt::format("'{}': cannot tell the up axis: {}, expected near one of the axes; state the up axis",
                               excerpt(people.name), figures));
}

Eigen::Matrix3d rotation_of(Axis up) {
  const double quarter = 0.5 * std::numbers::pi;
  const auto turned = [&](double angle, const Eigen::Vector3d& about) {
    // A quarter turn has entries 0 and 1 and nothing between.
    return Eigen::Matrix3d(Eigen::AngleAxisd(angle, about).toRotationMatrix().array().round());
  };
  switch (up) {
    case Axis::kPlusX:
      return turned(-quarter, Eigen::Vector3d::UnitY());
    case Axis::kMinusX:
      return turned(quarter, Eigen::Vector3d::UnitY());
    case Axis::kPlusY:
      return turned(quarter, Eigen::Vector3d::UnitX());
    case Axis::kMinusY:
      return turned(-quarter, Eigen::Vector3d::UnitX());
    case Axis::kPlusZ:
      return Eigen::Matrix3d::Identity();
    case Axis::kMinusZ:
      return turned(2.0 * quarter, Eigen::Vector3d::UnitX());
  }
  return Eigen::Matrix3d::Identity();
}

std::string_view to_string(Axis axis) {
  constexpr std::array<std::string_view, 6> kNames = {"+x", "-x", "+y", "-y", "+z", "-z"};
  return kNames[static_cast<std::size_t>(axis)];
}

Axis parse_axis(std::string_view text) {
  for (int i = 0; i < 6; ++i) {
    const auto axis = static_cast<Axis>(i);
    if (text == to_string(axis) || (i % 2 == 0 && text == to_string(axis).substr(1))) return axis;
  }
  throw std::invalid_argument(fmt::format("up axis: expected x, y, z, -x, -y or -z, found '{}'", excerpt(text)));
}

PeopleFinding<bool> find_mirror(const SampledPeople& people, const std::array<std::vector<Eigen::Vector3d>, 2>& faces,
                                bool has_toes, const PeopleOptions& options) {
  Pointing pointing;
  for (const std::size_t who : {0U, 1U})
    for (std::size_t i = 0; i < people[who].size(); ++i) {
      add_frame(people[who][i], people[1 - who][i], has_toes, pointing);
      const std::optional<Eigen::Vector2d> ahead = ahead_of(people[who][i]);
      if (!ahead || faces[who].empty()) continue;
      const Eigen::Vector2d face = faces[who][i].head<2>();
      if (face.norm() > kLeastLevelToe) pointing.face.add(face.dot(*ahead) / face.norm());
    }
  if (options.mirrored) return {*options.mirrored, mirror_sentence(*options.mirrored, pointing) + ", as told"};
  const bool mirrored = says_mirrored(pointing);
  return {mirrored, mirror_sentence(mirrored, pointing)};
}

PeopleFinding<Eigen::Matrix3d> find_level(const RawPeople& raw, const SampledPeople& people,
                                          const PeopleOptions& options) {
  const Eigen::Matrix3d kept = Eigen::Matrix3d::Identity();
  if (options.level && !*options.level) return {kept, "level: the world is kept (as told)"};
  const Eigen::Vector3d normal = floor_normal(people);
  const double tilt = std::acos(std::min(normal.z(), 1.0));
  const std::string found =
      fmt::format("the floor that feet and uprights fit best is {:.1f} degrees off level", tilt / kDegree);
  if (!options.level && raw.up) return {kept, fmt::format("level: kept, the format's world is level ({})", found)};
  if (!options.level && tilt < kLeastTilt) return {kept, fmt::format("level: kept ({})", found)};
  if (!(tilt < std::acos(kUprightCosine)))
    throw InputError(
        fmt::format("'{}': {}: nobody can stand on it; state the up axis, or that it is not to be levelled",
                    excerpt(raw.name), found));
  const Eigen::Matrix3d R = Eigen::Quaterniond::FromTwoVectors(normal, Eigen::Vector3d::UnitZ()).toRotationMatrix();
  return {R, fmt::format("level: turned by {:.1f} degrees ({}, along {}){}", tilt / kDegree, found,
                         direction_text(normal), options.level ? ", as told" : "")};
}

PeopleFinding<double> find_floor(const SampledPeople& people, const PeopleOptions& options) {
  std::vector<double> lowest;
  for (const auto& person : people)
    for (const SmplFrame& p : person)
      lowest.push_back(std::min({p(2, kLeftToe), p(2, kRightToe), p(2, kLeftAnkle), p(2, kRightAnkle)}));
  const double height = quantile(std::move(lowest), 0.5) - kToeHeight;
  if (options.floor) {
    require(std::isfinite(*options.floor), "expected a finite height of the floor, found {}", *options.floor);
    return {-*options.floor,
            fmt::format("floor: at {:.3f} m (as told; the feet say {:.3f} m)", *options.floor, height)};
  }
  if (std::abs(height) <= kFloorKept)
    return {0.0, fmt::format("floor: heights kept (the feet put it at {:.3f} m)", height)};
  return {-height, fmt::format("floor: at {:.3f} m in the file, by the median of the lower foot; moved to 0", height)};
}

}  // namespace duet
