#include "duet/motion/people/object_shape.h"

#include <fmt/format.h>

#include <algorithm>
#include <charconv>
#include <cmath>
#include <limits>
#include <nlohmann/json.hpp>
#include <string_view>
#include <vector>

#include "duet/core/data_file.h"
#include "duet/core/json.h"
#include "duet/core/require.h"
#include "duet/core/text.h"
#include "duet/motion/carried_object.h"

namespace duet {
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
            fmt::format("'{}': line {}: expected a vertex 'v x y z', found '{}'", file, number, shown(word)));
    }
    check_point(vertex, fmt::format("'{}': line {}", file, number));
    vertices.push_back(vertex);
  }
  return vertices;
}

Eigen::Vector3d vector_of(const nlohmann::json& value, const std::string& where) {
  if (!value.is_array() || value.size() != 3 || !value[0].is_number() || !value[1].is_number() || !value[2].is_number())
    throw InputError(fmt::format("{}: expected three numbers, found {}", where, shown(dumped(value))));
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
      throw InputError(fmt::format("'{}': unknown key '{}'; known: points, or box and centre", file, shown(key)));
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
    throw InputError(fmt::format("'{}': expected the shape of an object as .obj or .json", shown(path)));
  const std::string text = read_plain_text(path, kMostShapeBytes);
  const std::vector<Eigen::Vector3d> points = is_mesh ? vertices_of_obj(text, path) : points_of_json(text, path);
  if (points.empty()) throw InputError(fmt::format("'{}': expected points of an object, found none", path));
  Eigen::Matrix3Xd all(3, static_cast<long>(points.size()));
  for (std::size_t i = 0; i < points.size(); ++i) all.col(static_cast<long>(i)) = points[i];
  return farthest_points(all, kMostObjectKeypoints);
}

}  // namespace duet
