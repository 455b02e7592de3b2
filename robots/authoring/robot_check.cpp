#include "duet/robots/authoring/robot_check.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <set>
#include <sstream>
#include <utility>

#include "duet/core/file.h"
#include "duet/core/require.h"
#include "duet/robots/card.h"
#include "duet/robots/robot_cards.h"
#include "duet/robots/urdf.h"

namespace duet {
namespace {

constexpr double kOfABody = 1e-3;                             // share by which principal moments may miss a body's
constexpr std::pair<double, double> kGyration = {1e-3, 2.0};  // radii of gyration of a part of a humanoid [m]

// Holds a card against a URDF, each whole by itself.
class CardAgainstUrdf {
 public:
  CardAgainstUrdf(const RobotCard& card, const UrdfModel& urdf) : urdf_(urdf) {
    for (const CardJoint& joint : card.joints) moved_.insert(joint.name);
    for (const CardLock& lock : card.locked) locked_.insert(lock.joint);
  }

  [[nodiscard]] std::vector<RobotFinding> findings() const {
    std::vector<RobotFinding> all = {joints(), inertias()};
    if (RobotFinding none = masses(); none.stops) all.push_back(std::move(none));
    return all;
  }

 private:
  // A joint that mimics a locked one is locked with it; a chain of those that mimic one another has an end.
  [[nodiscard]] bool is_locked(const UrdfJoint& joint, std::size_t depth = 0) const {
    if (locked_.contains(joint.name)) return true;
    if (joint.mimics.empty() || moved_.contains(joint.name) || depth > urdf_.joints.size()) return false;
    const auto other = std::ranges::find(urdf_.joints, joint.mimics, &UrdfJoint::name);
    return other != urdf_.joints.end() && is_locked(*other, depth + 1);
  }
  [[nodiscard]] static bool is_rigid(const UrdfJoint& joint) {
    return joint.type == UrdfJointType::kFixed || joint.type == UrdfJointType::kFloating;
  }

  [[nodiscard]] RobotFinding joints() const {
    std::vector<std::string> left_out, mimic, others;
    int moved = 0, locked = 0, fixed = 0;
    for (const UrdfJoint& joint : urdf_.joints) {
      if (is_rigid(joint)) {
        ++fixed;
      } else if (is_locked(joint)) {
        ++locked;
      } else if (!joint.mimics.empty()) {
        mimic.push_back(fmt::format("{} (of {})", joint.name, joint.mimics));
      } else if (joint.type != UrdfJointType::kRevolute && joint.type != UrdfJointType::kContinuous) {
        others.push_back(fmt::format("{} ({})", joint.name, to_string(joint.type)));
      } else if (moved_.contains(joint.name)) {
        ++moved;
      } else {
        left_out.push_back(joint.name);
      }
    }
    const std::string text = fmt::format("{} move, {} are locked, {} fixed", moved, locked, fixed);
    const auto stop = [&](CheckState state, const char* what, const std::vector<std::string>& names, const char* next) {
      return RobotFinding{"joints", state, fmt::format("{}; {}: {}", text, what, fmt::join(names, ", ")), next, true};
    };
    if (!mimic.empty())
      return stop(CheckState::kWrong, "that mimic another", mimic,
                  "lock them or the joint that they follow ('locked')");
    if (!others.empty()) return stop(CheckState::kWrong, "no hinges", others, "lock them ('locked')");
    if (!left_out.empty())
      return stop(CheckState::kMissing, "in neither list", left_out,
                  "name them in 'joints', or in 'locked' with a position");
    return {"joints", CheckState::kOk, text};
  }

  // Links that move by themselves with all that is rigid on them, and have no mass.
  [[nodiscard]] RobotFinding masses() const {
    std::vector<std::size_t> owner(urdf_.links.size(), 0);
    std::vector<double> mass(urdf_.links.size(), 0.0);
    mass[0] = urdf_.links[0].mass;
    for (const UrdfJoint& joint : urdf_.joints) {
      const auto child = static_cast<std::size_t>(joint.child);
      const bool own = moved_.contains(joint.name) || joint.type == UrdfJointType::kFloating;
      owner[child] = own ? child : owner[static_cast<std::size_t>(joint.parent)];
      mass[owner[child]] += urdf_.links[child].mass;
    }
    std::vector<std::string> none;
    for (std::size_t i = 0; i < mass.size(); ++i)
      if (owner[i] == i && mass[i] <= 0.0 && !is_world(i)) none.push_back(urdf_.links[i].name);
    if (none.empty()) return {};
    return {"mass", CheckState::kMissing, fmt::format("no mass with their fixed parts: {}", fmt::join(none, ", ")),
            "give these links an <inertial> in the URDF", true};
  }
  [[nodiscard]] bool is_world(std::size_t link) const {
    return link == 0 && !urdf_.joints.empty() && urdf_.joints[0].type == UrdfJointType::kFloating;
  }

  // Principal moments of a body: each at most the sum of the two others, of a plausible size for its mass.
  [[nodiscard]] RobotFinding inertias() const {
    std::vector<std::string> odd;
    int bodies = 0, points = 0;
    for (const UrdfLink& link : urdf_.links) {
      if (link.mass <= 0.0) continue;
      ++bodies;
      const Eigen::Vector3d I =
          Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d>(link.inertia, Eigen::EigenvaluesOnly).eigenvalues();
      if (I.isZero(0.0)) {
        ++points;
        continue;
      }
      const double radius = std::sqrt(std::max(I[2], 0.0) / link.mass);
      const auto say = [&](const char* why) {
        odd.push_back(fmt::format("{} ({:.2g}, {:.2g}, {:.2g} kg m^2 of {:.3g} kg: {})", link.name, I[0], I[1], I[2],
                                  link.mass, why));
      };
      if (I[0] + I[1] < (1.0 - kOfABody) * I[2])
        say("one is more than the two others");
      else if (radius < kGyration.first || radius > kGyration.second)
        say("of no such size");
    }
    const std::string text = fmt::format("{} links with mass, {} of them points", bodies, points);
    if (odd.empty()) return {"inertias", CheckState::kOk, text};
    constexpr std::size_t kShown = 3;
    const std::size_t shown = std::min(odd.size(), kShown);
    return {"inertias", CheckState::kWrong,
            fmt::format("{}; {} are no body's: {}{}", text, odd.size(),
                        fmt::join(odd.begin(), odd.begin() + static_cast<long>(shown), ", "),
                        odd.size() > shown ? ", ..." : ""),
            "look them up at the maker's: a placeholder, or another unit"};
  }

  const UrdfModel& urdf_;
  std::set<std::string> moved_, locked_;
};

// Lines of a card whose values nobody has measured.
std::vector<int> assumed_lines(const std::string& card) {
  std::vector<int> lines;
  std::istringstream text(card);
  int number = 0;
  for (std::string line; std::getline(text, line);)
    if (++number; line.find(kAssumed) != std::string::npos) lines.push_back(number);
  return lines;
}

}  // namespace

bool RobotCheck::can_run() const { return std::ranges::none_of(findings, &RobotFinding::stops); }

RobotCheck check_robot(const std::string& card) {
  RobotCheck check;
  check.card = card_path(card);
  const std::string text = read_text(check.card);
  const RobotCard parsed = parse_card(text, check.card);
  check.name = parsed.name;
  check.urdf = urdf_of(check.card, parsed);
  const UrdfModel urdf = parse_urdf(read_text(check.urdf), check.urdf);
  check.findings = CardAgainstUrdf(parsed, urdf).findings();
  try {
    const RobotModel robot = load_robot(check.card);
    for (RobotFinding& finding : findings_of(robot)) check.findings.push_back(std::move(finding));
    if (std::string note = dynamics_note(robot, urdf, check.urdf); !note.empty())
      check.findings.push_back({"dynamics", CheckState::kNote, std::move(note)});
  } catch (const InputError& error) {
    if (check.can_run())
      check.findings.push_back({"card", CheckState::kWrong, error.what(), "mend this line, then check again", true});
  }
  if (const std::vector<int> lines = assumed_lines(text); !lines.empty())
    check.findings.push_back(
        {"assumed", CheckState::kNote,
         fmt::format("{} lines hold values that nobody measured, the first is line {}", lines.size(), lines.front()),
         fmt::format("put the maker's numbers there and take '{}' away", kAssumed)});
  return check;
}

}  // namespace duet
