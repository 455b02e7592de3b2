#include "duet/replay/robot_outline.h"

#include <algorithm>
#include <limits>
#include <map>
#include <span>
#include <string>

#include "duet/robots/kinematics.h"

namespace duet {
namespace {

constexpr double kThickestAnkle = 0.045, kSocket = 0.045;  // [m]
constexpr double kInstep = 0.5, kInstepInward = 0.1;       // of the ankle's height; of the way to the ankle
constexpr double kBarPart = 0.9;                           // of the thinner of what it joins
constexpr double kJoined = 0.6;                            // overlap that is no gap, as a part of the thinner radius

// Spheres of one link that are drawn as one piece.
struct OutlinePart {
  int link = 0;
  std::vector<OutlineSphere> spheres;
};

// Both ends of a capsule and its middle, or the sphere.
std::vector<OutlineSphere> spheres_of(const RobotShape& shape) {
  const Eigen::Vector3d half = shape.X_LS.R * Eigen::Vector3d(0.0, 0.0, shape.half_length);
  if (shape.half_length <= 0.0) return {{shape.X_LS.p, shape.radius}};
  return {{shape.X_LS.p - half, shape.radius}, {shape.X_LS.p, shape.radius}, {shape.X_LS.p + half, shape.radius}};
}

// The sole's spheres, an instep above each, and the ankle.
OutlineHull foot_hull(const RobotModel& robot, int link, const Kinematics& standing) {
  OutlineHull foot{link, {}, {}, true};
  double lowest = std::numeric_limits<double>::infinity();
  for (const int shape : robot.feet) {
    if (robot.shapes[shape].link != link) continue;
    foot.shapes.push_back(shape);
    lowest = std::min(lowest, standing.shape_position(shape).z() - robot.shapes[shape].radius);
  }
  const double height = standing.p_WL(link).z() - lowest;
  const double ankle = std::clamp(0.85 * height, 0.01, kThickestAnkle);
  const Eigen::Vector3d up = standing.R_WL(link).transpose() * Eigen::Vector3d(0.0, 0.0, kInstep * height);
  for (const int shape : foot.shapes) {
    const OutlineSphere sole{robot.shapes[shape].X_LS.p, robot.shapes[shape].radius};
    foot.spheres.push_back(sole);
    foot.spheres.push_back({(1.0 - kInstepInward) * (sole.center + up), sole.radius});
  }
  foot.spheres.push_back({Eigen::Vector3d::Zero(), ankle});
  return foot;
}

// The shapes of the link's largest region, its own joint and those of the links that hang at it.
OutlineHull block_hull(const RobotModel& robot, int link) {
  OutlineHull block{link, {}, {}, false};
  std::map<std::string, double> sizes;
  for (const RobotShape& shape : robot.shapes)
    if (shape.link == link)
      sizes[shape.region] += shape.radius * shape.radius * (2.0 * shape.half_length + shape.radius);
  if (sizes.empty()) return block;
  const auto by_size = [](const auto& a, const auto& b) { return a.second < b.second; };
  const std::string region = std::ranges::max_element(sizes, by_size)->first;
  double thickest = 0.0;
  for (std::size_t i = 0; i < robot.shapes.size(); ++i) {
    if (robot.shapes[i].link != link || robot.shapes[i].region != region) continue;
    block.shapes.push_back(static_cast<int>(i));
    thickest = std::max(thickest, robot.shapes[i].radius);
    for (const OutlineSphere& sphere : spheres_of(robot.shapes[i])) block.spheres.push_back(sphere);
  }
  const double socket = std::min(kSocket, thickest);
  if (robot.links[link].parent >= 0) block.spheres.push_back({Eigen::Vector3d::Zero(), socket});
  for (const RobotLink& other : robot.links)
    if (other.parent == link) block.spheres.push_back({other.X_PL.p, socket});
  return block;
}

std::vector<OutlineHull> hulls_of(const RobotModel& robot, const Kinematics& standing) {
  std::vector<OutlineHull> hulls;
  for (int link = 0; link < static_cast<int>(robot.links.size()); ++link) {
    const auto is_sole = [&](int shape) { return robot.shapes[shape].link == link; };
    const auto hangs = std::ranges::count(robot.links, link, &RobotLink::parent);
    OutlineHull hull;
    if (std::ranges::any_of(robot.feet, is_sole))
      hull = foot_hull(robot, link, standing);
    else if (hangs >= 2)
      hull = block_hull(robot, link);
    if (!hull.spheres.empty()) hulls.push_back(std::move(hull));
  }
  return hulls;
}

// The parts that are drawn of each link: its hull first, then the shapes outside of it.
std::vector<std::vector<OutlinePart>> parts_of(const RobotModel& robot, const std::vector<OutlineHull>& hulls) {
  std::vector<std::vector<OutlinePart>> parts(robot.links.size());
  std::vector<bool> inside(robot.shapes.size(), false);
  for (const OutlineHull& hull : hulls) {
    parts[hull.link].push_back({hull.link, hull.spheres});
    for (const int shape : hull.shapes) inside[shape] = true;
  }
  for (std::size_t i = 0; i < robot.shapes.size(); ++i)
    if (!inside[i]) parts[robot.shapes[i].link].push_back({robot.shapes[i].link, spheres_of(robot.shapes[i])});
  return parts;
}

struct PartGap {
  double width = std::numeric_limits<double>::infinity();
  OutlineBar bar;
};

// The nearest pair of spheres of two parts, in the pose of `standing`.
PartGap gap_between(const OutlinePart& from, const OutlinePart& to, const Kinematics& standing) {
  PartGap nearest;
  for (const OutlineSphere& a : from.spheres) {
    const Eigen::Vector3d p = standing.p_WL(from.link) + standing.R_WL(from.link) * a.center;
    for (const OutlineSphere& b : to.spheres) {
      const Eigen::Vector3d q = standing.p_WL(to.link) + standing.R_WL(to.link) * b.center;
      const double thin = std::min(a.radius, b.radius), width = (p - q).norm() - a.radius - b.radius + kJoined * thin;
      if (width < nearest.width) nearest = {width, {from.link, to.link, a.center, b.center, kBarPart * thin}};
    }
  }
  return nearest;
}

// The parts that a part hangs from: those before it on its link, or those of the nearest link above that has any.
const std::vector<OutlinePart>* hangs_from(const RobotModel& robot, const std::vector<std::vector<OutlinePart>>& parts,
                                           int link) {
  for (int up = robot.links[link].parent; up >= 0; up = robot.links[up].parent)
    if (!parts[up].empty()) return &parts[up];
  return nullptr;
}

void add_bar(const OutlinePart& part, std::span<const OutlinePart> others, const Kinematics& standing,
             std::vector<OutlineBar>& bars) {
  PartGap nearest;
  for (const OutlinePart& other : others) {
    const PartGap gap = gap_between(other, part, standing);
    if (gap.width < nearest.width) nearest = gap;
  }
  if (!others.empty() && nearest.width > 0.0) bars.push_back(nearest.bar);
}

}  // namespace

RobotOutline robot_outline(const RobotModel& robot) {
  Kinematics standing(robot);
  standing.update(Pose{}, robot.neutral);
  RobotOutline outline;
  outline.hulls = hulls_of(robot, standing);
  const std::vector<std::vector<OutlinePart>> parts = parts_of(robot, outline.hulls);
  for (int link = 0; link < static_cast<int>(parts.size()); ++link) {
    for (std::size_t i = 0; i < parts[link].size(); ++i) {
      const std::span<const OutlinePart> before(parts[link].data(), i);
      if (i > 0)
        add_bar(parts[link][i], before, standing, outline.bars);
      else if (const std::vector<OutlinePart>* others = hangs_from(robot, parts, link))
        add_bar(parts[link][i], *others, standing, outline.bars);
    }
  }
  return outline;
}

}  // namespace duet
