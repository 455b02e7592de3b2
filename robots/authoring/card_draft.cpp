#include "duet/robots/authoring/card_draft.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <Eigen/Eigenvalues>
#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cctype>
#include <cmath>
#include <filesystem>
#include <functional>
#include <limits>
#include <map>
#include <nlohmann/json.hpp>
#include <set>
#include <utility>

#include "duet/core/json.h"
#include "duet/core/names.h"
#include "duet/core/require.h"
#include "duet/robots/authoring/limbs.h"
#include "duet/robots/authoring/robot_check.h"
#include "duet/robots/urdf.h"

namespace duet {
namespace {

constexpr double kTorque = 50.0, kSpeed = 10.0, kTurn = 1.5;  // where a URDF has no limits [N m], [rad/s], [rad]
constexpr double kDampingShare = 1.0 / 40.0;                 // of kd to kp [s]: near unitree_rl_gym's and booster_gym's
constexpr double kRotorShare = 1.5e-4;                       // of armature to torque [kg m^2 / N m]: near the G1's
constexpr std::pair<double, double> kRotor = {0.002, 0.05};  // [kg m^2]
constexpr double kSphere = 0.005;                            // radius of a sole's spheres [m]
constexpr double kPelvisNear = 0.11;                         // most that a link is from its hips to be the pelvis [m]
constexpr std::array<const char*, 2> kLeftRight = {"left", "right"};

// A name as YAML reads it back.
std::string yaml_word(const std::string& name) {
  const bool plain = !name.empty() && std::ranges::all_of(name, [](unsigned char c) {
    return std::isalnum(c) != 0 || c == '_' || c == '-' || c == '.' || c == '/';
  }) && name[0] != '-';
  return plain ? name : dumped(nlohmann::json(name));
}

double rounded(double value, double step) { return std::round(value / step) * step + 0.0; }

std::string triple(const Eigen::Vector3d& p) {
  return fmt::format("[{:.4g}, {:.4g}, {:.4g}]", rounded(p.x(), 1e-4), rounded(p.y(), 1e-4), rounded(p.z(), 1e-4));
}

class CardWriter {
 public:
  CardWriter(const UrdfModel& urdf, std::string file, CardDraft& draft)
      : urdf_(urdf), file_(std::move(file)), draft_(draft), limbs_(find_limbs(urdf)) {
    for (const UrdfJoint& joint : urdf.joints) {
      const bool turns = joint.type == UrdfJointType::kRevolute || joint.type == UrdfJointType::kContinuous;
      moves_.push_back(turns && joint.mimics.empty());
    }
    if (std::ranges::none_of(moves_, std::identity{}))
      throw InputError(fmt::format("{}: expected a robot with hinges, found none", file_));
    if (has_legs())  // of a robot whose build is not known every hinge moves
      for (const int j : limbs_.rest) moves_[j] = false;
    angles_ = standing_angles(urdf, limbs_);
    X_ = poses_in_base(urdf, limbs_.base, angles_);
    for (const UrdfLink& link : urdf.links) names_.insert(link.name);
  }

  void write(const std::string& urdf_in_card) {
    head(urdf_in_card);
    joints();
    locked();
    points();
    soles();
    roles();
    sizes();
    frames();  // all of them are known now
    draft_.text = head_ + joints_ + frames_ + people_ + shapes_ + roles_;
  }

 private:
  [[nodiscard]] const std::string& link_of(int joint) const { return urdf_.links[urdf_.joints[joint].child].name; }
  [[nodiscard]] const Pose& pose_of(int joint) const { return X_[urdf_.joints[joint].child]; }

  void head(const std::string& urdf_in_card) {
    double mass = 0.0;
    for (const UrdfLink& link : urdf_.links) mass += link.mass;
    head_ = fmt::format(
        "# Scaffold of a robot card, from {} alone. Lines that end with \"{}\" hold values that a URDF does not say: "
        "put the\n"
        "# maker's there. Say here whose description it is and under which licence. Then: duet robot check.\n"
        "# Every key: docs/file-formats.md, \"Robot card\".\n"
        "name: {}\n"
        "urdf: {}\n"
        "base: {}  # the URDF's root; {:.3f} kg in all\n\n",
        std::filesystem::path(file_).filename().string(), std::string(kAssumed).substr(2), draft_.name,
        yaml_word(urdf_in_card), yaml_word(urdf_.links[limbs_.base].name), mass);
  }

  void joints() {
    joints_ =
        "# In the URDF's order. kp follows from the torque limit (all of it at a radian), kd and armature from kp and "
        "torque as\n"
        "# published robots have them. neutral: zero, legs bent and arms lowered where they are straight or stretched "
        "out.\n"
        "joints:\n";
    std::vector<std::string> limitless;
    for (std::size_t j = 0; j < urdf_.joints.size(); ++j)
      if (moves_[j] && add_joint(static_cast<int>(j))) limitless.push_back(urdf_.joints[j].name);
    if (!limitless.empty())
      draft_.missing.push_back(fmt::format("limits of {} joints that the URDF gives none: {}", limitless.size(),
                                           fmt::join(limitless, ", ")));
    draft_.missing.emplace_back("armature, kp, kd and neutral: the maker's training or deployment has them");
  }

  // True where the URDF lacks a limit.
  bool add_joint(int j) {
    const UrdfJoint& joint = urdf_.joints[j];
    const double torque = joint.effort > 0.0 ? joint.effort : kTorque;
    const double kp = std::max(1.0, std::round(torque));
    std::string text =
        fmt::format("{{name: {}, armature: {:.2g}, kp: {:g}, kd: {:.3g}, neutral: {:.4g}", yaml_word(joint.name),
                    std::clamp(kRotorShare * torque, kRotor.first, kRotor.second), kp, kDampingShare * kp, angles_[j]);
    const bool turns = joint.lower < joint.upper;
    if (!turns) text += fmt::format(", lower: {:g}, upper: {:g}", -kTurn, kTurn);
    if (joint.effort <= 0.0) text += fmt::format(", effort: {:g}", kTorque);
    if (joint.velocity <= 0.0) text += fmt::format(", velocity: {:g}", kSpeed);
    joints_ += fmt::format("  - {}}}  {}; {}\n", text, kAssumed, turn_of(urdf_, limbs_, j));
    return !turns || joint.effort <= 0.0 || joint.velocity <= 0.0;
  }

  // A joint that mimics one that is locked is locked with it.
  void locked() {
    std::string text;
    int count = 0;
    for (const int j : limbs_.rest) {
      if (moves_[j]) continue;
      const UrdfJoint& joint = urdf_.joints[j];
      const auto other = std::ranges::find(urdf_.joints, joint.mimics, &UrdfJoint::name);
      if (!joint.mimics.empty() && other != urdf_.joints.end() && !moves_[other - urdf_.joints.begin()]) continue;
      text += fmt::format("  - {{name: {}, position: {:.4g}}}\n", yaml_word(joint.name), angles_[j]);
      ++count;
    }
    if (count == 0) return;
    joints_ +=
        "\n# Neither in a leg, an arm, the waist nor the neck: fingers, sliders, joints that mimic others.\nlocked:\n" +
        text;
    draft_.proposed.push_back(fmt::format("locked: {} joints that are in no limb", count));
  }

  // A name for a frame that no link and no other frame has.
  std::string frame(const std::string& name, int link, const Eigen::Vector3d& p, const std::string& from) {
    std::string free = name;
    while (!names_.insert(free).second) free += "_frame";
    frames_ += fmt::format("  - {{name: {}, link: {}, xyz: {}}}  {}\n", free, yaml_word(urdf_.links[link].name),
                           triple(p), from);
    return free;
  }
  // The same, at a place in the base.
  std::string frame_at(const std::string& name, int link, const Eigen::Vector3d& p_B, const std::string& from) {
    return frame(name, link, X_[link].inverse() * p_B, from);
  }

  [[nodiscard]] bool has_legs() const { return !limbs_.legs[0].empty(); }
  [[nodiscard]] bool has_arms() const { return limbs_.arms[0].size() >= 2; }

  // Places of a person on the robot, in the base: measured at hinges, else in proportion to the body.
  void points() {
    hips_ = has_legs() ? Eigen::Vector3d(0.5 * (pose_of(limbs_.legs[0][0]).p + pose_of(limbs_.legs[1][0]).p))
                       : X_[limbs_.base].p;
    double lowest = 0.0;
    for (const Pose& X : X_) lowest = std::min(lowest, X.p.z() - hips_.z());
    const double leg = std::max(0.2, -lowest);
    shoulders_ = has_arms() ? Eigen::Vector3d(0.5 * (pose_of(limbs_.arms[0][0]).p + pose_of(limbs_.arms[1][0]).p))
                            : Eigen::Vector3d(hips_ + Eigen::Vector3d(0.0, 0.0, 0.55 * leg));
    tracks_["torso"] = frame_at("chest_link", limbs_.trunk, hips_ + 0.6 * (shoulders_ - hips_), kAssumed);
    const double above = 0.3 * (shoulders_ - hips_).norm();
    if (limbs_.neck.empty())
      tracks_["head"] = frame_at("head_link", limbs_.trunk, shoulders_ + Eigen::Vector3d(0.0, 0.0, above), kAssumed);
    else
      tracks_["head"] = frame_at("head_link", urdf_.joints[limbs_.neck.back()].child,
                                 pose_of(limbs_.neck.back()).p + Eigen::Vector3d(0.0, 0.0, 0.5 * above), kAssumed);
    for (int side = 0; side < 2; ++side) {
      const char letter = kLeftRight[side][0];
      const std::string hand = fmt::format("{}_palm_link", kLeftRight[side]);
      const std::string shoulder = fmt::format("{}_shoulder_frame", kLeftRight[side]);
      const std::string lhand = fmt::format("{}hand", letter), lshoulder = fmt::format("{}shoulder", letter);
      if (has_arms()) {
        const std::vector<int>& arm = limbs_.arms[side];
        const UrdfLink& last = urdf_.links[urdf_.joints[arm.back()].child];
        tracks_[lshoulder] = link_of(arm[1]);
        tracks_[lhand] = frame(hand, urdf_.joints[arm.back()].child, 2.0 * last.com,
                               fmt::format("{}: twice as far as the link's centre of mass", kAssumed));
      } else {
        const double y = (side == 0 ? 1.0 : -1.0) * 0.25 * leg;
        tracks_[lshoulder] = frame_at(shoulder, limbs_.trunk, shoulders_ + Eigen::Vector3d(0.0, y, 0.0), kAssumed);
        tracks_[lhand] = frame_at(hand, limbs_.trunk, hips_ + Eigen::Vector3d(0.0, y, 0.0), kAssumed);
      }
    }
    if (has_legs()) pelvis();
    if (!has_arms())
      draft_.missing.emplace_back("places of the hands, the shoulders and the head, which its tracks follow");
    people();
  }

  void pelvis() {
    const bool near = (X_[limbs_.pelvis].p - hips_).norm() <= kPelvisNear;
    pelvis_ = near ? urdf_.links[limbs_.pelvis].name
                   : frame_at("pelvis_frame", limbs_.pelvis, hips_, "# between the first hinges of the legs");
  }

  // Pairs and keypoints of a robot that has all limbs; else the pelvis alone.
  void people() {
    people_ = "\n# What of the robot stands for which joint of a person: links at hinges by the roles below.\n";
    if (!has_legs()) {
      people_ += "pairs: []\nkeypoints: []\n";
    } else if (!has_arms() || limbs_.knee[0] < 0 || limbs_.elbow[0] < 0) {
      people_ += fmt::format("pairs:\n  - {{frame: {}, smpl: pelvis}}\nkeypoints: []\n", yaml_word(pelvis_));
    } else {
      whole_person();
    }
    people_ += "\n# What the detectors follow.\ntracks:\n";
    for (const char* track : {"head", "lhand", "rhand", "torso", "lshoulder", "rshoulder"})
      people_ += fmt::format("  {}: {}\n", track, yaml_word(tracks_[track]));
  }

  void whole_person() {
    std::string pairs, toes, points;
    const auto pair = [](std::string& out, const std::string& link, const std::string& joint) {
      out += fmt::format("  - {{frame: {}, smpl: {}}}\n", yaml_word(link), joint);
    };
    const auto point = [&](const std::string& name, const std::string& link) {
      points += fmt::format("  - {{name: {0}, frame: {1}, smpl: {0}}}\n", name, yaml_word(link));
    };
    pair(pairs, pelvis_, "pelvis");
    for (int side = 0; side < 2; ++side) {
      const std::string s = kLeftRight[side];
      const int ankle = limbs_.legs[side].back();
      pair(pairs, link_of(limbs_.legs[side][0]), s + "_hip");
      pair(pairs, link_of(limbs_.knee[side]), s + "_knee");
      pair(pairs, link_of(ankle), s + "_ankle");
      pair(toes,
           frame_at(s + "_toe_link", urdf_.joints[ankle].child, pose_of(ankle).p + Eigen::Vector3d(0.1, 0.0, -0.03),
                    kAssumed),
           s + "_toe");
    }
    const std::array<std::string, 2> hands = {tracks_["lhand"], tracks_["rhand"]};
    const std::array<std::string, 2> shoulders = {tracks_["lshoulder"], tracks_["rshoulder"]};
    for (int side = 0; side < 2; ++side) {
      const std::string s = kLeftRight[side];
      pair(pairs, shoulders[side], s + "_shoulder");
      pair(pairs, link_of(limbs_.elbow[side]), s + "_elbow");
      pair(pairs, hands[side], s + "_hand");
    }
    pair(pairs, tracks_["head"], "head");
    point("head", tracks_["head"]);
    for (int side = 0; side < 2; ++side) point(std::string(kLeftRight[side]) + "_shoulder", shoulders[side]);
    for (int side = 0; side < 2; ++side) point(std::string(kLeftRight[side]) + "_elbow", link_of(limbs_.elbow[side]));
    for (int side = 0; side < 2; ++side)
      point(std::string(kLeftRight[side]) + "_wrist", link_of(limbs_.arms[side].back()));
    for (int side = 0; side < 2; ++side) point(std::string(kLeftRight[side]) + "_hand", hands[side]);
    people_ += "pairs:\n" + pairs + toes + "keypoints:\n" + points;
  }

  // The corners of what is rigid on a foot, in the base: of its collision boxes, else of the box with its inertia.
  [[nodiscard]] std::pair<std::vector<Eigen::Vector3d>, bool> corners(int foot) const {
    std::vector<Eigen::Vector3d> shapes, solids;
    const auto add = [](std::vector<Eigen::Vector3d>& out, const Pose& X, const Eigen::Vector3d& half) {
      for (int i = 0; i < 8; ++i)
        out.push_back(
            X * Eigen::Vector3d((i & 1 ? 1 : -1) * half.x(), (i & 2 ? 1 : -1) * half.y(), (i & 4 ? 1 : -1) * half.z()));
    };
    for (std::size_t i = 0; i < urdf_.links.size(); ++i) {
      if (carrier_of(urdf_, static_cast<int>(i), moves_) != foot) continue;
      const UrdfLink& link = urdf_.links[i];
      for (const UrdfBox& box : link.boxes) add(shapes, X_[i] * box.X_LB, box.half);
      if (link.mass <= 0.0) continue;
      const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> solver(link.inertia);
      Eigen::Matrix3d R = solver.eigenvectors();
      if (R.determinant() < 0.0) R.col(0) *= -1.0;
      const Eigen::Vector3d I = solver.eigenvalues();
      const Eigen::Vector3d half =
          (1.5 / link.mass * (Eigen::Vector3d::Constant(I.sum()) - 2.0 * I)).cwiseMax(0.0).cwiseSqrt();
      add(solids, X_[i] * Pose{Eigen::Quaterniond(R), link.com}, half);
    }
    return shapes.empty() ? std::pair(solids, false) : std::pair(shapes, true);
  }

  // A left sole in the base: its low and high corner, where it was found.
  struct Sole {
    Eigen::Vector2d low, high;
    double ground = 0.0;
    std::string from;
    bool measured = false;
  };

  [[nodiscard]] static Sole around(const std::vector<Eigen::Vector3d>& points) {
    constexpr double kNearGround = 0.03;  // [m]
    Sole sole;
    sole.low = Eigen::Vector2d::Constant(std::numeric_limits<double>::infinity());
    sole.high = -sole.low;
    sole.ground = std::ranges::min(points, {}, [](const Eigen::Vector3d& p) { return p.z(); }).z();
    for (const Eigen::Vector3d& p : points) {
      if (p.z() > sole.ground + kNearGround) continue;
      sole.low = sole.low.cwiseMin(p.head<2>());
      sole.high = sole.high.cwiseMax(p.head<2>());
    }
    return sole;
  }

  // Well longer than wide, no deeper below the ankle than the feet of published robots are.
  [[nodiscard]] bool is_foot(const Sole& sole, const Eigen::Vector3d& ankle) const {
    const Eigen::Vector2d size = sole.high - sole.low;
    const double deep = ankle.z() - sole.ground, leg = hips_.z() - ankle.z();
    return size.minCoeff() > 0.02 * leg && size.y() <= 0.6 * size.x() && deep > 0.0 && deep < 0.2 * leg;
  }

  [[nodiscard]] Sole left_sole() const {
    const int foot = urdf_.joints[limbs_.legs[0].back()].child;
    const auto [points, measured] = corners(foot);
    const Eigen::Vector3d ankle = X_[foot].p;
    if (!points.empty()) {
      Sole sole = around(points);
      sole.measured = measured;
      sole.from =
          measured ? "# the URDF's collision shapes" : fmt::format("{}: a box with the foot's inertia", kAssumed);
      if (is_foot(sole, ankle)) return sole;
    }
    const double leg = std::max(0.1, hips_.z() - ankle.z());
    return {.low = ankle.head<2>() + leg * Eigen::Vector2d(-0.1, -0.05),
            .high = ankle.head<2>() + leg * Eigen::Vector2d(0.17, 0.05),
            .ground = ankle.z() - 0.08 * leg,
            .from = fmt::format("{}: in proportion to the leg", kAssumed)};
  }

  // Four spheres under each foot; the right ones mirror the left.
  void soles() {
    shapes_ =
        "\n# Collision shapes by body region. The lowest points of the spheres with 'sole' are the ground.\nshapes:\n";
    if (!has_legs()) {
      draft_.missing.emplace_back("legs, and soles under them");
      shapes_ += torso();
      return;
    }
    const Sole sole = left_sole();
    if (!sole.measured)
      draft_.missing.emplace_back("where the soles are: the foot's collision shapes are meshes or absent");
    for (int side = 0; side < 2; ++side)
      for (const double x : {sole.low.x() + kSphere, sole.high.x() - kSphere})
        for (const double y : {sole.high.y() - kSphere, sole.low.y() + kSphere}) {
          const int link = urdf_.joints[limbs_.legs[side].back()].child;
          const Eigen::Vector3d p_B(x, side == 0 ? y : 2.0 * hips_.y() - y, sole.ground + kSphere);
          shapes_ +=
              fmt::format("  - {{link: {}, kind: sphere, center: {}, radius: {:g}, region: foot, sole: true}}  {}\n",
                          yaml_word(urdf_.links[link].name), triple(X_[link].inverse() * p_B), kSphere, sole.from);
        }
    shapes_ += torso();
    draft_.proposed.push_back(fmt::format("soles: {:.0f} x {:.0f} mm, {:.0f} mm below the ankles ({})",
                                          1e3 * (sole.high.x() - sole.low.x()), 1e3 * (sole.high.y() - sole.low.y()),
                                          1e3 * (pose_of(limbs_.legs[0].back()).p.z() - sole.ground),
                                          sole.from.substr(2)));
  }

  [[nodiscard]] std::string torso() const {
    const Pose inverse = X_[limbs_.trunk].inverse();
    const Eigen::Vector3d along = shoulders_ - hips_;
    return fmt::format(
        "  - {{link: {}, kind: capsule, from: {}, to: {}, radius: {:.3g}, region: torso}}  {}\n\n"
        "self_collision: []\n",
        yaml_word(urdf_.links[limbs_.trunk].name), triple(inverse * (hips_ + 0.3 * along)),
        triple(inverse * (hips_ + 0.8 * along)), std::max(0.03, 0.2 * along.norm()), kAssumed);
  }

  [[nodiscard]] std::string names_of(const std::vector<int>& joints) const {
    std::vector<std::string> names;
    for (const int j : joints) names.push_back(yaml_word(urdf_.joints[j].name));
    return fmt::format("[{}]", fmt::join(names, ", "));
  }

  void limb(const char* key, const std::array<std::vector<int>, 2>& sides) {
    if (sides[0].empty()) return;
    roles_ += fmt::format("{}:\n", key);
    for (int side = 0; side < 2; ++side) roles_ += fmt::format("  {}: {}\n", kLeftRight[side], names_of(sides[side]));
    std::vector<std::string> turns;
    for (const int j : sides[0]) turns.push_back(turn_of(urdf_, limbs_, j));
    draft_.proposed.push_back(fmt::format("{}: {} hinges a side: {}", key, sides[0].size(), fmt::join(turns, ", ")));
  }

  void roles() {
    roles_ =
        "\n# Roles by the tree and the places and axes of the hinges at zero: two limbs that mirror one another and "
        "end lowest are the\n"
        "# legs, the longest other ones the arms; the waist lies between them.\n";
    limb("legs", limbs_.legs);
    if (!limbs_.waist.empty()) {
      roles_ += fmt::format("waist: {}\n", names_of(limbs_.waist));
      draft_.proposed.push_back(fmt::format("waist: {}", names_of(limbs_.waist)));
    }
    limb("arms", limbs_.arms);
    std::vector<int> wrists;
    for (int side = 0; side < 2; ++side) {
      const std::vector<int>& arm = limbs_.arms[side];
      const auto elbow = std::ranges::find(arm, limbs_.elbow[side]);
      if (elbow != arm.end()) wrists.insert(wrists.end(), elbow + 1, arm.end());
    }
    if (!wrists.empty()) roles_ += fmt::format("wrists: {}  # behind the elbow\n", names_of(wrists));
    if (limbs_.knee[0] >= 0)
      draft_.proposed.push_back(
          fmt::format("knees: {}; ankles begin at: {}", names_of({limbs_.knee[0], limbs_.knee[1]}),
                      limbs_.ankle[0] < 0 ? "none" : names_of({limbs_.ankle[0], limbs_.ankle[1]})));
    if (limbs_.elbow[0] >= 0)
      draft_.proposed.push_back(fmt::format("elbows: {}", names_of({limbs_.elbow[0], limbs_.elbow[1]})));
    if (!limbs_.neck.empty()) draft_.proposed.push_back(fmt::format("neck: {}", names_of(limbs_.neck)));
    roles_ += fmt::format("push_link: {}\n", yaml_word(urdf_.links[limbs_.trunk].name));
  }

  void sizes() {
    if (!has_legs()) return;
    const double half = 0.5 * (pose_of(limbs_.legs[0].back()).p.y() - pose_of(limbs_.legs[1].back()).p.y());
    if (half > 0.0)
      roles_ += fmt::format(
          "\n# Half the distance of the ankles; the shift is the G1's.\nstance: {{half_width: {:.4g}, shift: [0.02, "
          "0.03]}}\n",
          half);
  }

  void frames() { frames_ = "\n# Frames for what the URDF has no link for.\nframes:\n" + frames_; }

  const UrdfModel& urdf_;
  std::string file_;
  CardDraft& draft_;
  Limbs limbs_;
  std::vector<bool> moves_;     // of the URDF's joints: whether the card moves it
  std::vector<double> angles_;  // of the standing pose
  std::vector<Pose> X_;         // of the links in the base, standing
  std::set<std::string> names_;
  std::map<std::string, std::string> tracks_;
  Eigen::Vector3d hips_ = Eigen::Vector3d::Zero(), shoulders_ = Eigen::Vector3d::Zero();
  std::string pelvis_, head_, joints_, frames_, people_, shapes_, roles_;
};

}  // namespace

CardDraft draft_card(const std::string& urdf_text, const std::string& file, std::string name,
                     const std::string& urdf_in_card) {
  const UrdfModel urdf = parse_urdf(urdf_text, file);
  CardDraft draft;
  if (name.empty()) name = std::filesystem::path(file).stem().string();
  if (!is_plain_name(name)) throw InputError(fmt::format("name of the robot: {}", plain_name_message(name)));
  draft.name = name;
  CardWriter(urdf, file, draft).write(urdf_in_card);
  return draft;
}

}  // namespace duet
