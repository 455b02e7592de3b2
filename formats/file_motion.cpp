#include "duet/formats/file_motion.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>

#include "duet/core/numbers.h"
#include "duet/core/require.h"
#include "duet/formats/motion_layout.h"
#include "duet/formats/motion_support.h"
#include "duet/robots/kinematics.h"

namespace duet {
namespace {

constexpr double kUnitNorm = 1e-6;
constexpr double kMendable = 0.1;          // deviation of a quaternion's length from 1 that is renormalised
constexpr double kSolesOnFloor = 0.05;     // [m] from z = 0, median of the lower sole: ankles of a G1 at 0.02 to 0.07 m
constexpr double kClearlyElsewhere = 0.2;  // [m] what the soles of the two orders differ by where they tell anything
constexpr double kLongestMotion = 86'400.0;  // [s]: what any rate turns into a number of frames that fits into memory
constexpr double kLimitMargin = 0.1;         // [rad] beyond the card's limits that still counts as inside
constexpr double kLowestBase = 0.2, kHighestBase = 2.0;  // plausible height of the base over its standing height
constexpr double kSameBodies = 0.05;                     // [m] mean distance at which bodies agree with our kinematics
constexpr double kStandingLow = 0.7, kStandingHigh = 1.3;  // height of the base over its standing height
constexpr int kTellingBodies = 8;                          // as many tell an order by the nearest of them
constexpr double kOftenQuick = 0.02;                       // share of steps
constexpr int kSampled = 60;                               // frames that detection looks at

[[noreturn]] void refuse_file(const FileMotion& file, const std::string& fault) {
  throw InputError(fmt::format("'{}': {}", file.path, fault));
}

// One choice of everything that is open.
struct FactChoice {
  QuaternionOrder quaternion = QuaternionOrder::kXyzw;
  TreeOrder joints = TreeOrder::kDepthFirst, bodies = TreeOrder::kDepthFirst;
  double radians = 1.0, metres = 1.0;
};

class Interpreter {
 public:
  Interpreter(const FileMotion& file, const MotionLayout& layout, const RobotModel& robot,
              const RobotMotionOptions& options)
      : file_(file), layout_(layout), robot_(robot), options_(options), kinematics_(robot) {
    result_.evidence = file.evidence;
    fact_.quaternion = options.quaternion.value_or(layout.quaternion);
    fact_.joints = fact_.bodies = options.joints.value_or(layout.joints);
  }

  RobotMotionFile run() {
    check_sizes();
    choose_rate();
    binding_ = bind_columns(file_.path, file_.joint_names, file_.q.rows(), robot_);
    for (const std::string& sentence : binding_.evidence) say(sentence);
    choose_angles();
    choose_metres();
    check_norms();
    choose_orders();
    fill();
    judge_bodies();
    say_doubts();
    return std::move(result_);
  }

 private:
  void say(std::string sentence) { result_.evidence.push_back(std::move(sentence)); }

  void check_sizes() const {
    const int frames = file_.frames();
    if (frames < 2) refuse_file(file_, fmt::format("expected at least 2 frames, found {}", frames));
    const std::size_t rotations = std::max(file_.quaternion.size(), file_.euler.size());
    if (file_.q.cols() != frames || rotations != static_cast<std::size_t>(frames))
      refuse_file(file_, fmt::format("expected as many frames of each array, found {} positions, {} rotations, {} rows "
                                     "of joint angles",
                                     frames, rotations, file_.q.cols()));
    if (!file_.q.allFinite()) refuse_file(file_, "a joint angle is not finite");
    for (const Eigen::Vector3d& p : file_.position)
      if (!p.allFinite()) refuse_file(file_, "a position of the root is not finite");
    if (!file_.bodies.empty() && file_.bodies.frames() != frames)
      refuse_file(file_, fmt::format("expected {} frames of bodies, found {}", frames, file_.bodies.frames()));
  }

  void choose_rate() {
    RobotMotion& motion = result_.motion;
    motion.rate_hz = options_.rate_hz ? *options_.rate_hz : file_.rate_hz ? *file_.rate_hz : layout_.rate_hz;
    if (!(motion.rate_hz >= kLowestRate && motion.rate_hz <= kHighestRate))
      refuse_file(file_,
                  fmt::format("expected a rate of {} to {} Hz, found {}", kLowestRate, kHighestRate, motion.rate_hz));
    const double seconds = file_.frames() / motion.rate_hz;
    if (seconds > kLongestMotion)
      refuse_file(file_, fmt::format("expected a motion of at most 24 h, found {} frames at {} Hz", file_.frames(),
                                     motion.rate_hz));
    say(fmt::format("rate: {} Hz, {} frames ({})", motion.rate_hz, file_.frames(),
                    options_.rate_hz ? "as told"
                    : file_.rate_hz  ? "the file says"
                                     : "the file does not say; the format's own"));
  }

  [[nodiscard]] const std::vector<int>& columns(TreeOrder order) const {
    return order == TreeOrder::kDepthFirst ? binding_.depth_first : binding_.breadth_first;
  }

  // Share of the angles that lie within the card's limits where the file's unit is this many radians.
  [[nodiscard]] double share_in_limits(double radians) const {
    const std::vector<int>& joint = columns(fact_.joints);
    double inside = 0.0, all = 0.0;
    for (Eigen::Index k = 0; k < file_.q.rows(); ++k) {
      if (joint[static_cast<std::size_t>(k)] < 0) continue;
      const RobotJoint& limits = robot_.joints[static_cast<std::size_t>(joint[static_cast<std::size_t>(k)])];
      const Eigen::ArrayXd q = file_.q.row(k).array() * radians;
      inside += static_cast<double>((q >= limits.lower - kLimitMargin && q <= limits.upper + kLimitMargin).count());
      all += static_cast<double>(q.size());
    }
    return all > 0.0 ? inside / all : 1.0;
  }

  // Radians that are degrees leave the limits of the joints; the other way round nothing can tell.
  void choose_angles() {
    constexpr double kDegree = std::numbers::pi / 180.0;
    constexpr double kOften = 0.9;
    AngleUnit unit = options_.angles.value_or(layout_.angles);
    const double in_radians = share_in_limits(1.0), in_degrees = share_in_limits(kDegree);
    const char* why = options_.angles ? "as told" : "as documented";
    const bool beyond_a_turn = file_.q.size() > 0 && file_.q.cwiseAbs().maxCoeff() > 2.0 * std::numbers::pi;
    if (!options_.angles && unit == AngleUnit::kRadians && in_radians < kOften && in_degrees >= kOften &&
        beyond_a_turn) {
      unit = AngleUnit::kDegrees;
      why = "detected";
    }
    fact_.radians = unit == AngleUnit::kDegrees ? kDegree : 1.0;
    // A motion that bends no joint by more than 3.1 degrees may be half a turn whose unit was taken for the other one.
    const double bend = file_.q.size() > 0 ? file_.q.cwiseAbs().maxCoeff() * fact_.radians / kDegree : 0.0;
    if (!options_.angles && bend > 0.0 && bend <= std::numbers::pi)
      say(fmt::format(
          "doubt: no joint is bent by more than {:.2g} degrees; is the unit of the angles right (--angles)?", bend));
    say(fmt::format("angles: {} ({}): within the joint limits {:.1f} % as rad, {:.1f} % as deg", to_string(unit), why,
                    100.0 * in_radians, 100.0 * in_degrees));
  }

  // A root that is nowhere near a robot's height along z, and is along another axis, is in a file with another axis up.
  void require_up() const {
    for (int axis = 0; axis < 2; ++axis) {
      std::vector<double> heights;
      for (const Eigen::Vector3d& p : file_.position) heights.push_back(std::abs(p[axis]));
      const double height = quantile(std::move(heights), 0.5);
      for (const double metres : {1.0, 0.01, 0.001}) {
        const double share = height * metres / robot_.standing_height;
        if (share < kStandingLow || share > kStandingHigh) continue;
        refuse_file(file_,
                    fmt::format("expected z up, but the root's median height is that of robot '{}' along {} ({:.4g} "
                                "units); turn the file, or say its unit of length with --units",
                                robot_.name, axis == 0 ? "x" : "y", height));
      }
    }
  }

  void choose_metres() {
    fact_.metres = options_.metres.value_or(layout_.metres);
    if (!(fact_.metres > 0.0) || !std::isfinite(fact_.metres))
      refuse_file(file_, fmt::format("expected a unit of length above 0 m, found {}", fact_.metres));
    std::vector<double> heights;
    for (const Eigen::Vector3d& p : file_.position) heights.push_back(p.z());
    const double height = quantile(std::move(heights), 0.5);
    const auto plausible = [&](double metres) {
      const double share = height * metres / robot_.standing_height;
      return share >= kLowestBase && share <= kHighestBase;
    };
    const char* why = options_.metres ? "as told" : "as documented";
    if (!options_.metres && robot_.standing_height > 0.0 && !plausible(fact_.metres)) {
      for (const double metres : {1.0, 0.01, 0.001}) {
        if (!plausible(metres)) continue;
        fact_.metres = metres;
        why = "detected";
        break;
      }
    }
    if (!options_.metres && robot_.standing_height > 0.0 && !plausible(fact_.metres)) require_up();
    say(
        fmt::format("length: {:g} m a unit ({}): the root's median height is {:.4g} units, {:.3f} m; '{}' stands at "
                    "{:.3f} m",
                    fact_.metres, why, height, height * fact_.metres, robot_.name, robot_.standing_height));
  }

  void check_norms() {
    double worst = 0.0;
    std::size_t worst_frame = 0;
    for (std::size_t t = 0; t < file_.quaternion.size(); ++t) {
      const double norm = file_.quaternion[t].norm();
      const double off = std::abs(norm - 1.0);
      if (!(off <= kMendable))
        refuse_file(file_,
                    fmt::format("root rotation of frame {}: expected a unit quaternion, found length {}", t, norm));
      if (off > worst) worst_frame = t;
      worst = std::max(worst, off);
    }
    if (file_.quaternion.empty()) {
      say("root rotation: turns about the fixed axes x, y, z");
    } else if (worst > kUnitNorm) {
      say(fmt::format("root rotation: renormalised, worst length off by {:.4f} in frame {}", worst, worst_frame));
    }
  }

  [[nodiscard]] Pose root(int frame, QuaternionOrder order) const {
    const auto t = static_cast<std::size_t>(frame);
    const Eigen::Vector3d p = file_.position[t] * fact_.metres;
    if (file_.quaternion.empty()) {
      const Eigen::Vector3d angle = file_.euler[t] * fact_.radians;
      const Eigen::Quaterniond R = Eigen::AngleAxisd(angle.z(), Eigen::Vector3d::UnitZ()) *
                                   Eigen::AngleAxisd(angle.y(), Eigen::Vector3d::UnitY()) *
                                   Eigen::AngleAxisd(angle.x(), Eigen::Vector3d::UnitX());
      return {.R = R.normalized(), .p = p};
    }
    const Eigen::Vector4d& c = file_.quaternion[t];
    const Eigen::Quaterniond R = order == QuaternionOrder::kXyzw ? Eigen::Quaterniond(c[3], c[0], c[1], c[2])
                                                                 : Eigen::Quaterniond(c[0], c[1], c[2], c[3]);
    return {.R = R.normalized(), .p = p};
  }

  [[nodiscard]] Eigen::VectorXd angles(int frame, TreeOrder order) const {
    const std::vector<int>& joint = columns(order);
    Eigen::VectorXd q = Eigen::VectorXd::Zero(robot_.dof());
    for (std::size_t k = 0; k < joint.size(); ++k)
      if (joint[k] >= 0) q[joint[k]] = file_.q(static_cast<Eigen::Index>(k), frame) * fact_.radians;
    return q;
  }

  [[nodiscard]] int stride() const { return std::max(1, file_.frames() / kSampled); }

  // Median height of the lower sole; not a number where the robot has no soles. [m]
  [[nodiscard]] double sole_height(QuaternionOrder order) {
    if (robot_.feet.empty()) return std::numeric_limits<double>::quiet_NaN();
    std::vector<double> heights;
    for (int t = 0; t < file_.frames(); t += stride()) {
      kinematics_.update(root(t, order), angles(t, fact_.joints));
      double lowest = std::numeric_limits<double>::infinity();
      for (const int shape : robot_.feet)
        lowest = std::min(
            lowest, kinematics_.shape_position(shape).z() - robot_.shapes[static_cast<std::size_t>(shape)].radius);
      heights.push_back(lowest);
    }
    return quantile(std::move(heights), 0.5);
  }

  // Links of the file's bodies; -1 where the robot lacks one. Empty where their number fits no order.
  [[nodiscard]] std::vector<int> body_links(TreeOrder order) const {
    std::vector<int> links;
    if (!file_.body_names.empty()) {
      for (const std::string& name : file_.body_names) {
        const auto found = std::find_if(robot_.links.begin(), robot_.links.end(),
                                        [&](const RobotLink& link) { return link.name == name; });
        links.push_back(found == robot_.links.end() ? -1 : static_cast<int>(found - robot_.links.begin()));
      }
    } else {
      const std::vector<int> all = links_in_order(robot_, order);
      for (const int number : file_.body_numbers)
        links.push_back(
            number >= 0 && static_cast<std::size_t>(number) < all.size() ? all[static_cast<std::size_t>(number)] : -1);
      if (file_.body_numbers.empty()) links = all;
    }
    if (links.size() != static_cast<std::size_t>(file_.bodies.points())) links.clear();
    return links;
  }

  struct BodyDistance {
    double mean = std::numeric_limits<double>::infinity(), worst = 0.0;
    int bodies = 0;
  };

  // The distance of the file's bodies from our kinematics, over sampled frames (all where `all`). [m]
  [[nodiscard]] BodyDistance body_distance(const FactChoice& fact, bool all) {
    const std::vector<int> links = body_links(fact.bodies);
    const double metres = file_.bodies_in_base ? 1.0 : fact_.metres;
    double sum = 0.0, count = 0.0;
    BodyDistance distance;
    for (int t = 0; t < file_.frames(); t += all ? 1 : stride()) {
      kinematics_.update(file_.bodies_in_base ? Pose() : root(t, fact.quaternion), angles(t, fact.joints));
      for (std::size_t b = 0; b < links.size(); ++b) {
        if (links[b] < 0) continue;
        const double off = (kinematics_.p_WL(links[b]) - metres * file_.bodies.at(t, static_cast<int>(b))).norm();
        sum += off;
        count += 1.0;
        distance.worst = std::max(distance.worst, off);
      }
    }
    distance.bodies = static_cast<int>(std::count_if(links.begin(), links.end(), [](int link) { return link >= 0; }));
    if (count > 0.0) distance.mean = sum / count;
    return distance;
  }

  // Bodies other than the base itself tell the order of joints and bodies.
  [[nodiscard]] bool has_witness() const { return file_.bodies.points() >= 3 && !body_links(fact_.bodies).empty(); }

  // Every so many frames of the motion under one choice of what is open.
  [[nodiscard]] RobotMotion motion_of(const FactChoice& fact, int every) const {
    RobotMotion motion;
    motion.rate_hz = result_.motion.rate_hz;
    motion.joint_names = robot_.joint_names();
    motion.q.resize(robot_.dof(), (file_.frames() + every - 1) / every);
    for (int t = 0; t < file_.frames(); t += every) {
      motion.root.push_back(root(t, fact.quaternion));
      motion.q.col(t / every) = angles(t, fact.joints);
    }
    return motion;
  }

  // With the order of quaternions that speaks least against it.
  [[nodiscard]] MotionSupport support(TreeOrder joints) const {
    FactChoice fact = fact_;
    fact.joints = joints;
    if (file_.quaternion_witness) fact.quaternion = *file_.quaternion_witness;
    const MotionSupport documented = support_of(robot_, motion_of(fact, stride()));
    if (options_.quaternion || file_.quaternion_witness || file_.quaternion.empty()) return documented;
    fact.quaternion = fact.quaternion == QuaternionOrder::kXyzw ? QuaternionOrder::kWxyz : QuaternionOrder::kXyzw;
    const MotionSupport other = support_of(robot_, motion_of(fact, stride()));
    return other.doubts() < documented.doubts() ? other : documented;
  }

  // Mean distance of the robot's links from the nearest body of the file. [m]
  [[nodiscard]] double nearest_bodies(TreeOrder joints) {
    const double metres = file_.bodies_in_base ? 1.0 : fact_.metres;
    double sum = 0.0, count = 0.0;
    for (int t = 0; t < file_.frames(); t += stride()) {
      kinematics_.update(file_.bodies_in_base ? Pose() : root(t, fact_.quaternion), angles(t, joints));
      for (int link = 0; link < static_cast<int>(robot_.links.size()); ++link) {
        double nearest = std::numeric_limits<double>::infinity();
        for (int b = 0; b < file_.bodies.points(); ++b)
          nearest = std::min(nearest, (kinematics_.p_WL(link) - metres * file_.bodies.at(t, b)).norm());
        sum += nearest;
        count += 1.0;
      }
    }
    return sum / count;
  }

  // Columns without names and without bodies that tell: by the robot's own body, where it speaks for one order alone.
  void choose_joints() {
    const TreeOrder documented = fact_.joints;
    const TreeOrder other = documented == TreeOrder::kDepthFirst ? TreeOrder::kBreadthFirst : TreeOrder::kDepthFirst;
    if (options_.joints || columns(documented) == columns(other)) {
      say(fmt::format("joints: {}, {}; the file does not name them", to_string(documented),
                      options_.joints ? "as told" : "as documented"));
      return;
    }
    const MotionSupport here = support(documented), there = support(other);
    std::string figures =
        fmt::format("as {}: {}; as {}: {}", to_string(documented), here.text(), to_string(other), there.text());
    bool better =
        there.doubts() < here.doubts() && (there.doubts() == 0 || (there.fits_limits() && !here.fits_limits()));
    if (file_.bodies.points() >= kTellingBodies) {
      const double near = nearest_bodies(documented), far = nearest_bodies(other);
      figures += fmt::format("; the links are {:.3f} m and {:.3f} m from the nearest bodies of the file", near, far);
      better =
          std::min(near, far) < kSameBodies && std::max(near, far) > 2.0 * std::min(near, far) ? far < near : better;
    }
    if (!better && !options_.angles && !here.fits_limits() && !there.fits_limits())
      refuse_file(file_,
                  fmt::format("neither order of the joints fits robot '{}', and the file does not name them ({}); "
                              "say the order with --joints, or name the columns",
                              robot_.name, figures));
    if (better) fact_.joints = other;
    say(fmt::format("joints: {}, {}; the file does not name them ({})", to_string(fact_.joints),
                    better ? "detected" : "as documented", figures));
  }

  // Says what speaks against the motion as it was read, so that nobody takes it unseen.
  void say_doubts() {
    const MotionSupport support = support_of(robot_, result_.motion);
    if (support.doubts() > 0) say(fmt::format("doubt: {}", support.text()));
    const double quick = share_too_quick(robot_, result_.motion);
    if (quick > kOftenQuick)
      say(fmt::format("doubt: at {} Hz a joint is quicker than its limit in {:.1f} % of the steps",
                      result_.motion.rate_hz, 100.0 * quick));
    if (result_.kinematics_error && *result_.kinematics_error > kSameBodies)
      say("doubt: the file's bodies are elsewhere than its joints put them");
  }

  void choose_orders() {
    const bool by_bodies = has_witness() && choose_by_bodies();
    if (file_.joint_names.empty() && !by_bodies) choose_joints();
    if (!file_.quaternion.empty() && !(by_bodies && !file_.bodies_in_base)) choose_quaternion();
    const double height = sole_height(fact_.quaternion);
    if (std::isfinite(height)) say(fmt::format("lower sole: {:.3f} m over the floor (median)", height));
  }

  // Every combination that is open; the documented one where none agrees with our kinematics.
  bool choose_by_bodies() {
    FactChoice best = fact_;
    BodyDistance least = body_distance(best, false);
    for (const QuaternionOrder quaternion : {QuaternionOrder::kXyzw, QuaternionOrder::kWxyz})
      for (const TreeOrder joints : {TreeOrder::kDepthFirst, TreeOrder::kBreadthFirst})
        for (const TreeOrder bodies : {TreeOrder::kDepthFirst, TreeOrder::kBreadthFirst}) {
          if (options_.quaternion && quaternion != *options_.quaternion) continue;
          if (options_.joints && joints != *options_.joints) continue;
          FactChoice choice = fact_;
          choice.quaternion = quaternion;
          choice.joints = joints;
          choice.bodies = bodies;
          const BodyDistance distance = body_distance(choice, false);
          if (distance.mean < least.mean - kUnitNorm) {
            least = distance;
            best = choice;
          }
        }
    if (least.mean > kSameBodies) {
      say(fmt::format("bodies: {} of the file and our kinematics disagree in every order ({:.3f} m on average)",
                      least.bodies, least.mean));
      return false;
    }
    fact_ = best;
    if (file_.joint_names.empty())
      say(fmt::format("joints: {} ({})", to_string(fact_.joints),
                      options_.joints ? "as told" : "by the file's body positions"));
    if (file_.body_names.empty()) say(fmt::format("bodies: {}, by their positions", to_string(fact_.bodies)));
    if (!file_.bodies_in_base && !file_.quaternion.empty())
      say(fmt::format("root rotation: {} ({})", to_string(fact_.quaternion),
                      options_.quaternion ? "as told" : "by the file's body positions"));
    return true;
  }

  void choose_quaternion() {
    const QuaternionOrder documented = fact_.quaternion;
    const QuaternionOrder other =
        documented == QuaternionOrder::kXyzw ? QuaternionOrder::kWxyz : QuaternionOrder::kXyzw;
    const double height = sole_height(documented), other_height = sole_height(other);
    const char* why = options_.quaternion ? "as told" : "as documented";
    const auto on_floor = [](double h) { return std::abs(h) <= kSolesOnFloor; };
    if (!options_.quaternion && file_.quaternion_witness) {
      fact_.quaternion = *file_.quaternion_witness;
      why = "the file says";
    } else if (!options_.quaternion && !on_floor(height) && on_floor(other_height) &&
               std::abs(height - other_height) >= kClearlyElsewhere) {
      fact_.quaternion = other;
      why = "detected";
    }
    say(fmt::format("root rotation: {} ({}): the lower sole is at {:.3f} m as {}, {:.3f} m as {}",
                    to_string(fact_.quaternion), why, height, to_string(documented), other_height, to_string(other)));
  }

  void fill() {
    result_.motion = motion_of(fact_, 1);
    try {
      validate(result_.motion, fmt::format("'{}'", file_.path));
    } catch (const std::invalid_argument& error) {
      throw InputError(error.what());
    }
  }

  void judge_bodies() {
    if (file_.bodies.empty() || body_links(fact_.bodies).empty()) return;
    const BodyDistance distance = body_distance(fact_, true);
    if (distance.bodies == 0) return;
    result_.kinematics_error = distance.worst;
    say(fmt::format("its body positions and our kinematics differ by {:.2e} m at most ({} bodies)", distance.worst,
                    distance.bodies));
  }

  const FileMotion& file_;
  const MotionLayout& layout_;
  const RobotModel& robot_;
  const RobotMotionOptions& options_;
  Kinematics kinematics_;
  FactChoice fact_;
  ColumnBinding binding_;
  RobotMotionFile result_;
};

}  // namespace

RobotMotionFile interpret(const FileMotion& file, const MotionLayout& layout, const RobotModel& robot,
                          const RobotMotionOptions& options) {
  return Interpreter(file, layout, robot, options).run();
}

}  // namespace duet
