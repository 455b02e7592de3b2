// The loader: a card and a URDF become a RobotModel.
#include <fmt/format.h>
#include <fmt/ranges.h>

#include <Eigen/Eigenvalues>
#include <Eigen/Geometry>
#include <algorithm>
#include <filesystem>
#include <optional>

#include "duet/core/file.h"
#include "duet/core/named_table.h"
#include "duet/core/names.h"
#include "duet/core/recording.h"
#include "duet/core/require.h"
#include "duet/core/share.h"
#include "duet/robots/card.h"
#include "duet/robots/kinematics.h"
#include "duet/robots/robot_model.h"
#include "duet/robots/urdf.h"

namespace duet {
namespace {

// Shapes of links that so few joints join touch, or cannot meet, whatever the joints do.
constexpr int kJointsApart = 3;

// Two bodies as one: mass, centre of mass and inertia of `part`, posed in the frame of `link`, added to it.
void add_body(RobotLink& link, const UrdfLink& part, const Pose& X_LPart) {
  if (part.mass <= 0.0) return;
  const Eigen::Matrix3d R = X_LPart.R.toRotationMatrix();
  const Eigen::Vector3d com = X_LPart * part.com;
  const double mass = link.mass + part.mass;
  const Eigen::Vector3d both = (link.mass * link.com + part.mass * com) / mass;
  const auto moved = [](double m, const Eigen::Vector3d& d) -> Eigen::Matrix3d {
    return m * (d.squaredNorm() * Eigen::Matrix3d::Identity() - d * d.transpose());
  };
  link.inertia += moved(link.mass, link.com - both) + R * part.inertia * R.transpose() + moved(part.mass, com - both);
  link.com = both;
  link.mass = mass;
}

// Builds one model; its members are the state that the steps share.
class Loader {
 public:
  Loader(const RobotCard& card, std::string card_file, const UrdfModel& urdf, std::string urdf_file)
      : card_(card), urdf_(urdf), card_file_(std::move(card_file)), urdf_file_(std::move(urdf_file)) {}

  RobotModel load() {
    model_.name = card_.name;
    find_base();
    check_joints();
    place_links();
    add_frames();
    for (size_t i = 0; i < card_.shapes.size(); ++i) add_shape(card_.shapes[i]);
    for (const CardPoint& pair : card_.pairs) model_.pairs.push_back({frame_of(pair), pair.smpl});
    for (const CardPoint& point : card_.keypoints)
      model_.keypoints.push_back({point.name, frame_of(point), point.smpl});
    for (const CardPoint& track : card_.tracks) model_.tracks[track.name] = frame_of(track);
    for (const CardRegions& regions : card_.self_collision) add_self_collision(regions);
    std::sort(model_.self_collision.begin(), model_.self_collision.end());
    check_links();
    set_standing_height();
    move_origin();
    bind_roles(card_, model_);
    return std::move(model_);
  }

 private:
  [[noreturn]] static void fail_card(const CardPlace& place, const std::string& message) {
    throw InputError(fmt::format("{}:{}: {}", place.file, place.line, message));
  }
  [[noreturn]] void fail_urdf(const std::string& message) const {
    throw InputError(fmt::format("{}: {}", urdf_file_, message));
  }

  int urdf_link(const std::string& name) const {
    const auto it =
        std::find_if(urdf_.links.begin(), urdf_.links.end(), [&](const UrdfLink& link) { return link.name == name; });
    return it == urdf_.links.end() ? -1 : static_cast<int>(it - urdf_.links.begin());
  }

  std::vector<std::string> urdf_link_names() const { return names_of(urdf_.links); }

  // The base is the root, or the only child of a massless root through a floating joint (a "world" link).
  void find_base() {
    base_ = urdf_link(card_.base);
    if (base_ < 0)
      fail_card(card_.base_place, fmt::format("'base' with {}: {}", urdf_file_,
                                              unknown_name_message("link", card_.base, urdf_link_names())));
    if (base_ == 0) return;
    const bool floats = base_ == 1 && urdf_.joints[0].type == UrdfJointType::kFloating && urdf_.links[0].mass == 0.0 &&
                        std::count_if(urdf_.joints.begin(), urdf_.joints.end(),
                                      [](const UrdfJoint& joint) { return joint.parent == 0; }) == 1;
    if (!floats)
      fail_card(card_.base_place, fmt::format("'base': expected the root link of {}, '{}', found '{}'", urdf_file_,
                                              urdf_.links[0].name, card_.base));
  }

  const CardJoint* card_joint(const std::string& name) const {
    const auto it = std::find_if(card_.joints.begin(), card_.joints.end(),
                                 [&](const CardJoint& joint) { return joint.name == name; });
    return it == card_.joints.end() ? nullptr : &*it;
  }
  const CardLock* card_lock(const std::string& name) const {
    const auto it = std::find_if(card_.locked.begin(), card_.locked.end(),
                                 [&](const CardLock& lock) { return lock.joint == name; });
    return it == card_.locked.end() ? nullptr : &*it;
  }
  const UrdfJoint* urdf_joint(const std::string& name) const {
    const auto it = std::find_if(urdf_.joints.begin(), urdf_.joints.end(),
                                 [&](const UrdfJoint& joint) { return joint.name == name; });
    return it == urdf_.joints.end() ? nullptr : &*it;
  }

  // Where the card locks it, or what it mimics. `depth`: a chain of those that mimic one another has an end.
  std::optional<double> locked_at(const UrdfJoint& joint, std::size_t depth = 0) const {
    if (const CardLock* const lock = card_lock(joint.name)) return lock->position;
    const UrdfJoint* const other = joint.mimics.empty() ? nullptr : urdf_joint(joint.mimics);
    if (other == nullptr || card_joint(joint.name) != nullptr || depth > urdf_.joints.size()) return std::nullopt;
    const std::optional<double> at = locked_at(*other, depth + 1);
    if (!at) return std::nullopt;
    return joint.mimic_factor * *at + joint.mimic_offset;
  }
  bool is_locked(const UrdfJoint& joint) const { return locked_at(joint).has_value(); }
  bool above_base(const UrdfJoint& joint) const { return joint.child <= base_; }

  void check_joints() const {
    std::vector<std::string> movable, extra;
    for (const UrdfJoint& joint : urdf_.joints) {
      if (joint.type == UrdfJointType::kFixed || above_base(joint)) continue;
      movable.push_back(joint.name);
      if (is_locked(joint)) continue;
      if (!joint.mimics.empty())
        fail_urdf(
            fmt::format("joint '{}': expected an independent joint, or one that the card locks ('locked'), found one "
                        "that mimics '{}'",
                        joint.name, joint.mimics));
      if (joint.type != UrdfJointType::kRevolute && joint.type != UrdfJointType::kContinuous)
        fail_urdf(fmt::format("joint '{}': expected revolute, continuous or fixed, found {}", joint.name,
                              to_string(joint.type)));
      if (card_joint(joint.name) == nullptr) extra.push_back(joint.name);
    }
    for (const CardJoint& joint : card_.joints) {
      if (std::find(movable.begin(), movable.end(), joint.name) == movable.end())
        fail_card(joint.place,
                  fmt::format("with {}: {}", urdf_file_, unknown_name_message("joint", joint.name, movable)));
      if (card_lock(joint.name) != nullptr)
        fail_card(joint.place,
                  fmt::format("joint '{}': expected it in 'joints' or in 'locked', found it in both", joint.name));
    }
    for (const CardLock& lock : card_.locked)
      if (std::find(movable.begin(), movable.end(), lock.joint) == movable.end())
        fail_card(lock.place,
                  fmt::format("with {}: {}", urdf_file_, unknown_name_message("joint", lock.joint, movable)));
    if (!extra.empty())
      throw InputError(fmt::format("{}: expected every joint of {} in 'joints' or 'locked', found none for: {}",
                                   card_file_, urdf_file_, fmt::join(extra, ", ")));
  }

  // Pose of a joint's child in its parent with a locked joint at its position.
  Pose locked_pose(const UrdfJoint& joint) const {
    const std::optional<double> position = locked_at(joint);
    if (!position) return joint.X_PC;
    if (joint.type == UrdfJointType::kFloating || joint.type == UrdfJointType::kPlanar)
      fail_urdf(
          fmt::format("joint '{}': expected one that can be locked, found {}", joint.name, to_string(joint.type)));
    const CardLock* const lock = card_lock(joint.name);
    if (lock != nullptr && (*position < joint.lower || *position > joint.upper))
      fail_card(lock->place, fmt::format("locked joint '{}': expected a position in [{}, {}], found {}", joint.name,
                                         joint.lower, joint.upper, *position));
    if (joint.type == UrdfJointType::kPrismatic)
      return joint.X_PC * Pose{Eigen::Quaterniond::Identity(), *position * joint.axis};
    return joint.X_PC * Pose{Eigen::Quaterniond(Eigen::AngleAxisd(*position, joint.axis)), Eigen::Vector3d::Zero()};
  }

  // Links in the card's order of joints; every URDF link gets its place (link, pose in it).
  void place_links() {
    const int n = static_cast<int>(card_.joints.size());
    model_.links.resize(n + 1);
    model_.joints.resize(n);
    model_.neutral.resize(n);
    place_.assign(urdf_.links.size(), {});
    place_[base_] = {0, {}};
    model_.links[0].name = card_.base;
    add_body(model_.links[0], urdf_.links[base_], {});
    for (const UrdfJoint& joint : urdf_.joints) {
      if (above_base(joint)) continue;
      const Place& parent = place_[joint.parent];
      const CardJoint* const card = card_joint(joint.name);
      if (card == nullptr) {
        place_[joint.child] = {parent.link, parent.X * locked_pose(joint)};
      } else {
        const int index = static_cast<int>(card - card_.joints.data()) + 1;
        if (parent.link >= index)
          fail_card(card->place, fmt::format("joint '{}': expected it after its parent joint '{}'", joint.name,
                                             card_.joints[parent.link - 1].name));
        model_.links[index] = {.name = urdf_.links[joint.child].name,
                               .parent = parent.link,
                               .X_PL = parent.X * joint.X_PC,
                               .axis = joint.axis};
        set_joint(index - 1, joint, *card);
        place_[joint.child] = {index, {}};
      }
      add_body(model_.links[place_[joint.child].link], urdf_.links[joint.child], place_[joint.child].X);
    }
  }

  void set_joint(int index, const UrdfJoint& urdf, const CardJoint& card) {
    RobotJoint joint{.name = card.name,
                     .lower = card.lower.value_or(urdf.lower),
                     .upper = card.upper.value_or(urdf.upper),
                     .effort = card.effort.value_or(urdf.effort),
                     .velocity = card.velocity.value_or(urdf.velocity),
                     .armature = card.armature,
                     .kp = card.kp,
                     .kd = card.kd};
    const auto fail = [&](const std::string& message) {
      throw InputError(fmt::format("joint '{}' of {} and {}:{}: {}", card.name, urdf_file_, card.place.file,
                                   card.place.line, message));
    };
    if (joint.lower >= joint.upper)
      fail(fmt::format("expected lower < upper, found [{}, {}]", joint.lower, joint.upper));
    if (joint.effort <= 0.0) fail(fmt::format("expected an effort limit > 0, found {}", joint.effort));
    if (joint.velocity <= 0.0) fail(fmt::format("expected a velocity limit > 0, found {}", joint.velocity));
    if (card.neutral < joint.lower || card.neutral > joint.upper)
      fail(fmt::format("expected a neutral angle in [{}, {}], found {}", joint.lower, joint.upper, card.neutral));
    model_.joints[index] = joint;
    model_.neutral[index] = card.neutral;
  }

  void add_frames() {
    for (size_t i = base_; i < urdf_.links.size(); ++i)
      model_.frames.push_back({urdf_.links[i].name, place_[i].link, place_[i].X});
    for (const CardFrame& frame : card_.frames) {
      const Place& place = place_of_link(frame.link, frame.place);
      const RobotFrame entry{frame.name, place.link, place.X * frame.X_LF};
      const auto same = std::find_if(model_.frames.begin(), model_.frames.end(),
                                     [&](const RobotFrame& other) { return other.name == frame.name; });
      if (same != model_.frames.end() && !frame.replaces_urdf_link)
        fail_card(frame.place,
                  fmt::format("frame '{}': expected a name that {} does not use (or replaces_urdf_link: true), "
                              "found the name of one of its links",
                              frame.name, urdf_file_));
      if (same != model_.frames.end())
        *same = entry;
      else
        model_.frames.push_back(entry);
    }
  }

  struct Place {
    int link = 0;
    Pose X;  // of the URDF link in that link
  };

  const Place& place_of_link(const std::string& name, const CardPlace& place) const {
    const int index = urdf_link(name);
    if (index < base_)
      fail_card(place, fmt::format("with {}: {}", urdf_file_, unknown_name_message("link", name, urdf_link_names())));
    return place_[index];
  }

  int frame_of(const CardPoint& point) const {
    try {
      return model_.frame_index(point.frame);
    } catch (const std::invalid_argument& error) {
      fail_card(point.place, error.what());
    }
  }

  void add_shape(const CardShape& card) {
    const Place& place = place_of_link(card.link, card.place);
    const Eigen::Vector3d axis = card.to - card.from;
    Pose X_FS{Eigen::Quaterniond::Identity(), 0.5 * (card.from + card.to)};
    if (card.kind == ShapeKind::kCapsule) X_FS.R.setFromTwoVectors(Eigen::Vector3d::UnitZ(), axis);
    if (card.sole) model_.feet.push_back(static_cast<int>(model_.shapes.size()));
    model_.shapes.push_back({card.kind, place.link, place.X * X_FS, card.radius, 0.5 * axis.norm(), card.region});
  }

  void add_self_collision(const CardRegions& regions) {
    check_region(regions.first, regions.place);
    check_region(regions.second, regions.place);
    const int n = static_cast<int>(model_.shapes.size());
    for (int i = 0; i < n; ++i)
      for (int j = i + 1; j < n; ++j) {
        const RobotShape &a = model_.shapes[i], &b = model_.shapes[j];
        const bool named = (a.region == regions.first && b.region == regions.second) ||
                           (a.region == regions.second && b.region == regions.first);
        if (named && joints_between(a.link, b.link) > kJointsApart) model_.self_collision.emplace_back(i, j);
      }
  }

  void check_region(const std::string& name, const CardPlace& place) const {
    std::vector<std::string> known;
    for (const CardShape& shape : card_.shapes)
      if (std::find(known.begin(), known.end(), shape.region) == known.end()) known.push_back(shape.region);
    if (std::find(known.begin(), known.end(), name) == known.end())
      fail_card(place, fmt::format("'self_collision': {}", unknown_name_message("region", name, known)));
  }

  int joints_between(int a, int b) const {
    int joints = 0;
    for (; a != b; ++joints) (a > b ? a : b) = model_.links[std::max(a, b)].parent;
    return joints;
  }

  void check_links() const {
    for (const RobotLink& link : model_.links) {
      if (link.mass <= 0.0)
        fail_urdf(fmt::format("link '{}': expected a mass > 0 with its fixed parts, found {}", link.name, link.mass));
      const double least =
          Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d>(link.inertia, Eigen::EigenvaluesOnly).eigenvalues()[0];
      if (least <= 0.0)
        fail_urdf(
            fmt::format("link '{}': expected a positive definite inertia with its fixed parts, found a "
                        "principal moment of {:.3g}",
                        link.name, least));
    }
  }

  void set_standing_height() {
    if (model_.feet.empty()) return;
    Kinematics kinematics(model_);
    kinematics.update({}, model_.neutral);
    double lowest = 0.0;
    for (const int foot : model_.feet) {
      const RobotShape& shape = model_.shapes[foot];
      const Eigen::Vector3d axis = kinematics.R_WL(shape.link) * (shape.X_LS.R * Eigen::Vector3d::UnitZ());
      const double bottom = kinematics.shape_position(foot).z() - shape.half_length * std::abs(axis.z()) - shape.radius;
      lowest = foot == model_.feet.front() ? bottom : std::min(lowest, bottom);
    }
    model_.standing_height = -lowest;
  }

  // The pelvis pair's place in the base's frame, in the neutral pose; without one, the middle between the hips.
  [[nodiscard]] std::optional<Eigen::Vector3d> pelvis() const {
    Kinematics kinematics(model_);
    kinematics.update({}, model_.neutral);
    for (const RetargetPair& pair : model_.pairs)
      if (pair.smpl == kPelvis) return kinematics.frame_position(pair.frame);
    Eigen::Vector3d hips = Eigen::Vector3d::Zero();
    for (const std::vector<CardName>& leg : card_.roles.legs) {
      const auto hip = std::find_if(model_.joints.begin(), model_.joints.end(), [&](const RobotJoint& joint) {
        return !leg.empty() && joint.name == leg.front().name;
      });
      if (hip == model_.joints.end()) return std::nullopt;
      hips += 0.5 * kinematics.p_WL(static_cast<int>(hip - model_.joints.begin()) + 1);
    }
    return hips;
  }

  // A URDF may have its origin anywhere, as exports from CAD do; a fall, a stance and a root are of the body.
  void move_origin() {
    if (model_.feet.empty()) return;
    const std::optional<Eigen::Vector3d> p_BP = pelvis();
    if (!p_BP && model_.standing_height <= 0.0)
      throw InputError(
          fmt::format("{}: the base's origin in {} is {:.2f} m below its soles: expected 'pairs' with the "
                      "pelvis, or 'legs', that tell where the body is, found neither",
                      card_file_, urdf_file_, -model_.standing_height));
    if (!p_BP || p_BP->norm() <= kOriginShare * (p_BP->z() + model_.standing_height)) return;
    model_ = with_origin_at(std::move(model_), *p_BP);
  }

  const RobotCard& card_;
  const UrdfModel& urdf_;
  std::string card_file_, urdf_file_;
  int base_ = 0;
  std::vector<Place> place_;  // per URDF link
  RobotModel model_;
};

}  // namespace

std::string dynamics_note(const RobotModel& robot, const UrdfModel& urdf, const std::string& file) {
  int joints = 0;
  double damping = 0.0, friction = 0.0;
  for (const UrdfJoint& joint : urdf.joints) {
    const bool moved = std::ranges::find(robot.joints, joint.name, &RobotJoint::name) != robot.joints.end();
    if (!moved || (joint.damping == 0.0 && joint.friction == 0.0)) continue;
    ++joints;
    damping = std::max(damping, joint.damping);
    friction = std::max(friction, joint.friction);
  }
  if (joints == 0) return "";
  return fmt::format(
      "{}: <dynamics> of {} joints (damping up to {:g} N m s/rad, friction up to {:g} N m) is not "
      "simulated: joints move without either",
      file, joints, damping, friction);
}

std::string urdf_of(const std::string& card_path, const RobotCard& card) {
  const std::vector<std::string> places =
      published_places(std::filesystem::path(card_path).parent_path().string(), card.urdf);
  std::error_code ignored;
  for (const std::string& place : places)
    if (std::filesystem::exists(place, ignored)) return place;
  throw MissingError(
      fmt::format("{}: the description '{}' is absent (it is looked for beside the card, in $DUET_MODELS and in "
                  "$DUET_SHARED/models and $DUET_SHARED/arena)",
                  card_path, card.urdf));
}

RobotModel load_robot(const std::string& card_path, const std::string& urdf_path) {
  const std::string card_text = read_text(card_path);
  const RobotCard card = parse_card(card_text, card_path);
  const std::string path = urdf_path.empty() ? urdf_of(card_path, card) : urdf_path;
  const std::string urdf_text = read_text(path);
  const UrdfModel urdf = parse_urdf(urdf_text, path);
  RobotModel model = Loader(card, card_path, urdf, path).load();
  model.digest = robot_digest(urdf_text, card.content);
  return model;
}

std::vector<std::string> robot_notes(const std::string& card) {
  const std::string path = card_path(card);
  const RobotModel robot = load_robot(path);
  const std::string file = urdf_of(path, parse_card(read_text(path), path));
  std::vector<std::string> notes;
  if (const double away = urdf_origin(robot).norm(); away > 0.0)
    notes.push_back(
        fmt::format("{}: its base's origin is {:.2f} m from the pelvis in the neutral pose; heights of the "
                    "base are the pelvis's",
                    file, away));
  if (std::string note = dynamics_note(robot, parse_urdf(read_text(file), file), file); !note.empty())
    notes.push_back(std::move(note));
  return notes;
}

}  // namespace duet
