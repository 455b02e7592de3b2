#include "duet/motion/carried_object.h"

#include <fmt/format.h>

#include <algorithm>
#include <charconv>
#include <cmath>
#include <limits>
#include <nlohmann/json.hpp>
#include <string_view>
#include <vector>

#include "duet/core/file.h"
#include "duet/core/json.h"
#include "duet/core/require.h"
#include "duet/motion/human_motion.h"
#include "duet/motion/npz_fields.h"

namespace duet {
namespace {

constexpr double kUnitRotation = 1e-6;  // |R| - 1, as for the robot's root

}  // namespace

void validate(const CarriedObject& object, int frames, const std::string& what) {
  if (object.empty()) return;
  require(static_cast<int>(object.poses.size()) == frames, "{}: expected {} poses, one a frame, found {}", what, frames,
          object.poses.size());
  require(object.keypoints.cols() >= 1 && object.keypoints.cols() <= kMostObjectKeypoints,
          "{}: expected 1 to {} keypoints, found {}", what, kMostObjectKeypoints, object.keypoints.cols());
  require(object.keypoints.allFinite(), "{}: a keypoint is not finite", what);
  for (std::size_t t = 0; t < object.poses.size(); ++t) {
    const Pose& X_WO = object.poses[t];
    require(X_WO.p.allFinite(), "{}: frame {}: the position is not finite", what, t);
    require(std::abs(X_WO.R.norm() - 1.0) <= kUnitRotation,
            "{}: frame {}: expected a unit quaternion, found one of norm {}", what, t, X_WO.R.norm());
  }
}

PointTracks keypoint_tracks(const CarriedObject& object) {
  if (object.empty()) return {};
  PointTracks tracks(static_cast<int>(object.poses.size()), static_cast<int>(object.keypoints.cols()));
  for (int t = 0; t < tracks.frames(); ++t) {
    const Pose& X_WO = object.poses[static_cast<std::size_t>(t)];
    tracks.frame(t) = (X_WO.R.toRotationMatrix() * object.keypoints).colwise() + X_WO.p;
  }
  return tracks;
}

CarriedObject resample(const CarriedObject& object, double rate_hz, double new_rate_hz) {
  if (object.empty() || rate_hz == new_rate_hz) return object;
  const int frames = static_cast<int>(object.poses.size());
  const int new_frames = resampled_frames(frames, rate_hz, new_rate_hz);
  CarriedObject result{.poses = {}, .keypoints = object.keypoints};
  result.poses.reserve(static_cast<std::size_t>(new_frames));
  for (int t = 0; t < new_frames; ++t) {
    const FrameBetween at = frame_between(t * (rate_hz / new_rate_hz), frames);
    const Pose& before = object.poses[static_cast<std::size_t>(at.frame)];
    result.poses.push_back(
        at.part > 0.0 ? interpolate(before, object.poses[static_cast<std::size_t>(at.frame) + 1], at.part) : before);
  }
  return result;
}

CarriedObject held(const CarriedObject& object, int before, int after) {
  if (object.empty()) return object;
  CarriedObject result = object;
  result.poses.insert(result.poses.begin(), static_cast<std::size_t>(before), object.poses.front());
  result.poses.insert(result.poses.end(), static_cast<std::size_t>(after), object.poses.back());
  return result;
}

CarriedObject mirrored(const CarriedObject& object) {
  if (object.empty()) return object;
  CarriedObject result = object;
  result.keypoints.row(1) *= -1.0;
  for (Pose& X_WO : result.poses) {
    X_WO.p.y() *= -1.0;
    X_WO.R = Eigen::Quaterniond(X_WO.R.w(), -X_WO.R.x(), X_WO.R.y(), -X_WO.R.z());  // S R S, S = diag(1, -1, 1)
  }
  return result;
}

void put_object(Npz& npz, const CarriedObject& object) {
  if (object.empty()) return;
  const std::size_t frames = object.poses.size();
  std::vector<double> positions;
  std::vector<Eigen::Quaterniond> rotations;
  positions.reserve(3 * frames);
  rotations.reserve(frames);
  for (const Pose& X_WO : object.poses) {
    positions.insert(positions.end(), {X_WO.p.x(), X_WO.p.y(), X_WO.p.z()});
    rotations.push_back(X_WO.R);
  }
  npz.set("object_position", std::move(positions), {frames, 3});
  put_quaternions(npz, "object_quat_wxyz", rotations, {frames, 4});
  // Column-major (3, O) has the bytes of row-major (O, 3).
  npz.set("object_keypoints",
          std::vector<double>(object.keypoints.data(), object.keypoints.data() + object.keypoints.size()),
          {static_cast<std::size_t>(object.keypoints.cols()), 3});
}

CarriedObject get_object(const Npz& npz) {
  CarriedObject object;
  if (!npz.contains("object_position") && !npz.contains("object_quat_wxyz") && !npz.contains("object_keypoints"))
    return object;
  const std::vector<double> positions = npz.numbers("object_position", {-1, 3});
  const std::size_t frames = positions.size() / 3;
  const std::vector<Eigen::Quaterniond> rotations =
      get_quaternions(npz, "object_quat_wxyz", {static_cast<long>(frames), 4});
  object.poses.reserve(frames);
  for (std::size_t t = 0; t < frames; ++t)
    object.poses.push_back({.R = rotations[t], .p = Eigen::Map<const Eigen::Vector3d>(&positions[3 * t])});
  const std::vector<double> keypoints = npz.numbers("object_keypoints", {-1, 3});
  object.keypoints = Eigen::Map<const Eigen::Matrix3Xd>(keypoints.data(), 3, static_cast<long>(keypoints.size() / 3));
  if (object.empty())
    throw InputError(fmt::format("'{}': key 'object_position': expected poses, found none", npz.name()));
  return object;
}

namespace {

constexpr std::int64_t kMostShapeBytes = std::int64_t{256} << 20;
constexpr double kFarthestPoint = 100.0;  // of an object that people carry, from its origin [m]

// The next word of a line, which it is taken from.
std::string_view next_word(std::string_view& line) {
  const std::size_t begin = line.find_first_not_of(" \t\r");
  if (begin == std::string_view::npos) return line = {};
  line.remove_prefix(begin);
  const std::string_view word = line.substr(0, line.find_first_of(" \t\r"));
  line.remove_prefix(word.size());
  return word;
}

void check_point(const Eigen::Vector3d& point, const std::string& where) {
  if (!point.allFinite() || point.cwiseAbs().maxCoeff() > kFarthestPoint)
    throw InputError(fmt::format("{}: expected metres, at most {:g} from the origin, found ({:g}, {:g}, {:g})", where,
                                 kFarthestPoint, point.x(), point.y(), point.z()));
}

// Lines "v x y z [w]"; all others say nothing of where the vertices are.
std::vector<Eigen::Vector3d> vertices_of_obj(std::string_view text, const std::string& file) {
  std::vector<Eigen::Vector3d> vertices;
  for (int number = 1; !text.empty(); ++number) {
    const std::size_t end = std::min(text.find('\n'), text.size());
    std::string_view line = text.substr(0, end);
    text.remove_prefix(std::min(end + 1, text.size()));
    if (next_word(line) != "v") continue;
    Eigen::Vector3d vertex;
    for (double& value : vertex) {
      const std::string_view word = next_word(line);
      const auto [stop, error] = std::from_chars(word.data(), word.data() + word.size(), value);
      if (error != std::errc() || stop != word.data() + word.size())
        throw InputError(
            fmt::format("'{}': line {}: expected a vertex 'v x y z', found '{}'", file, number, excerpt(word)));
    }
    check_point(vertex, fmt::format("'{}': line {}", file, number));
    vertices.push_back(vertex);
  }
  return vertices;
}

Eigen::Vector3d vector_of(const nlohmann::json& value, const std::string& where) {
  if (!value.is_array() || value.size() != 3 || !value[0].is_number() || !value[1].is_number() || !value[2].is_number())
    throw InputError(fmt::format("{}: expected three numbers, found {}", where, excerpt(dumped(value))));
  const Eigen::Vector3d vector(value[0].get<double>(), value[1].get<double>(), value[2].get<double>());
  check_point(vector, where);
  return vector;
}

std::vector<Eigen::Vector3d> corners_of(const nlohmann::json& root, const std::string& file) {
  const Eigen::Vector3d size = vector_of(root["box"], fmt::format("'{}': 'box'", file));
  if (!(size.minCoeff() > 0.0)) throw InputError(fmt::format("'{}': 'box': expected lengths above zero", file));
  Eigen::Vector3d centre = Eigen::Vector3d::Zero();
  if (root.contains("centre")) centre = vector_of(root["centre"], fmt::format("'{}': 'centre'", file));
  std::vector<Eigen::Vector3d> points = {centre};
  points.reserve(9);
  for (const double x : {-0.5, 0.5})
    for (const double y : {-0.5, 0.5})
      for (const double z : {-0.5, 0.5}) points.emplace_back(centre + Eigen::Vector3d(x, y, z).cwiseProduct(size));
  return points;
}

std::vector<Eigen::Vector3d> points_of_json(const std::string& text, const std::string& file) {
  const nlohmann::json root = parse_json(text, fmt::format("'{}'", file));
  if (!root.is_object() || root.contains("points") == root.contains("box"))
    throw InputError(fmt::format("'{}': expected an object with either 'points' or 'box'", file));
  for (const auto& [key, value] : root.items())
    if (key != "points" && key != "box" && !(key == "centre" && root.contains("box")))
      throw InputError(fmt::format("'{}': unknown key '{}'; known: points, or box and centre", file, excerpt(key)));
  if (root.contains("box")) return corners_of(root, file);
  const nlohmann::json& list = root["points"];
  if (!list.is_array()) throw InputError(fmt::format("'{}': 'points': expected a list of points", file));
  std::vector<Eigen::Vector3d> points;
  points.reserve(list.size());
  for (std::size_t i = 0; i < list.size(); ++i)
    points.push_back(vector_of(list[i], fmt::format("'{}': point {}", file, i)));
  return points;
}

}  // namespace

Eigen::Matrix3Xd farthest_points(const Eigen::Matrix3Xd& points, int count) {
  if (points.cols() <= count) return points;
  Eigen::Matrix3Xd chosen(3, count);
  Eigen::VectorXd distance = (points.colwise() - Eigen::Vector3d(points.rowwise().mean())).colwise().squaredNorm();
  Eigen::Index next = 0;
  distance.maxCoeff(&next);
  distance.setConstant(std::numeric_limits<double>::infinity());
  for (int i = 0; i < count; ++i) {
    chosen.col(i) = points.col(next);
    const Eigen::VectorXd to_new = (points.colwise() - Eigen::Vector3d(points.col(next))).colwise().squaredNorm();
    distance = distance.cwiseMin(to_new);
    distance.maxCoeff(&next);
  }
  return chosen;
}

Eigen::Matrix3Xd read_object_keypoints(const std::string& path) {
  const bool is_mesh = path.ends_with(".obj") || path.ends_with(".OBJ");
  if (!is_mesh && !path.ends_with(".json"))
    throw InputError(fmt::format("'{}': expected the shape of an object as .obj or .json", excerpt(path)));
  const std::string text = read_plain_text(path, kMostShapeBytes);
  const std::vector<Eigen::Vector3d> points = is_mesh ? vertices_of_obj(text, path) : points_of_json(text, path);
  if (points.empty()) throw InputError(fmt::format("'{}': expected points of an object, found none", path));
  Eigen::Matrix3Xd all(3, static_cast<long>(points.size()));
  for (std::size_t i = 0; i < points.size(); ++i) all.col(static_cast<long>(i)) = points[i];
  return farthest_points(all, kMostObjectKeypoints);
}

}  // namespace duet
