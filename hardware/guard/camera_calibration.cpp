#include "duet/hardware/guard/camera_calibration.h"

#include <fmt/format.h>

#include <Eigen/Dense>
#include <Eigen/Geometry>
#include <cmath>
#include <filesystem>
#include <span>

#include "duet/core/file.h"
#include "duet/core/require.h"
#include "duet/hardware/guard/person_log.h"
#include "duet/robots/yaml_schema.h"
#include "duet/robots/yaml_section.h"

namespace duet {
namespace {

constexpr const char* kCalibrationSchema = "duet.calibration/1";
constexpr double kAnkle = 0.08;        // of the ankles' joints over the floor, of somebody in shoes [m]
constexpr double kStandsStill = 0.10;  // most that the estimates of one place may scatter [m]
constexpr double kLeastAside = 0.3;    // of places from the line that fits them best [m]
constexpr int kLeastEstimates = 5, kLeastPlaces = 3;

std::vector<double> numbers(const YamlSection& of, const char* key, std::size_t count, const char* what) {
  const std::vector<YAML::Node> items = of.items(key);
  std::vector<double> values(items.size());
  bool good = items.size() == count;
  for (std::size_t k = 0; good && k < count; ++k)
    good = items[k].IsScalar() && YAML::convert<double>::decode(items[k], values[k]) && std::isfinite(values[k]);
  if (!good) of.fail_key(key, fmt::format("expected {}, found another", what));
  return values;
}

// The mean of the ankles in the estimates from `begin` to `end`.
void measure_place(const std::vector<RecordedEstimate>& log, double begin, double end, MarkedPlace& place) {
  std::vector<Eigen::Vector3d> ankles;
  PersonEstimate estimate;
  for (const RecordedEstimate& one : log) {
    if (one.at < begin || one.at > end) continue;
    if (decode(std::as_bytes(std::span(one.bytes)), estimate) != PersonFault::kNone || !estimate.seen) continue;
    ankles.push_back(0.5 * (estimate.joints.col(kLeftAnkle) + estimate.joints.col(kRightAnkle)));
  }
  place.estimates = static_cast<int>(ankles.size());
  place.p_CP.setZero();
  for (const Eigen::Vector3d& p : ankles) place.p_CP += p / static_cast<double>(ankles.size());
  double squares = 0.0;
  for (const Eigen::Vector3d& p : ankles) squares += (p - place.p_CP).squaredNorm();
  place.moved = ankles.empty() ? 0.0 : std::sqrt(squares / static_cast<double>(ankles.size()));
}

MarkedPlace read_place(const std::string& path, const YAML::Node& node, std::size_t number, double height,
                       const std::vector<RecordedEstimate>& log) {
  const YamlSection section(path, node, fmt::format("place {}", number), {"at", "seconds"});
  const std::vector<double> at = numbers(section, "at", 2, "[ahead, left] on the floor from below the base, in metres");
  const std::vector<double> seconds = numbers(section, "seconds", 2, "[begin, end] in the log");
  MarkedPlace place;
  place.p_BP = {at[0], at[1], kAnkle - height};
  measure_place(log, seconds[0], seconds[1], place);
  if (place.estimates < kLeastEstimates)
    section.fail_key("seconds",
                     fmt::format("expected at least {} estimates of somebody between {} s and {} s of the log, "
                                 "found {}",
                                 kLeastEstimates, seconds[0], seconds[1], place.estimates));
  if (place.moved > kStandsStill)
    section.fail_key("seconds",
                     fmt::format("expected somebody who stands still, found one whose ankles scatter by {:.2f} "
                                 "m",
                                 place.moved));
  return place;
}

// Distance of the places from the line that fits them best: the root of the mean square across it.
double aside(std::span<const MarkedPlace> places) {
  Eigen::Vector3d mean = Eigen::Vector3d::Zero();
  for (const MarkedPlace& place : places) mean += place.p_BP / static_cast<double>(places.size());
  Eigen::Matrix3d spread = Eigen::Matrix3d::Zero();
  for (const MarkedPlace& place : places) {
    const Eigen::Vector3d off = place.p_BP - mean;
    spread += off * off.transpose() / static_cast<double>(places.size());
  }
  const Eigen::Vector3d variances = Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d>(spread).eigenvalues();
  return std::sqrt(std::max(variances[0] + variances[1], 0.0));
}

Eigen::Matrix3d cross(const Eigen::Vector3d& v) {
  Eigen::Matrix3d m;
  m << 0, -v.z(), v.y(), v.z(), 0, -v.x(), -v.y(), v.x(), 0;
  return m;
}

}  // namespace

std::vector<MarkedPlace> read_marked_places(const std::string& path) {
  const YamlSection top(path, parse_yaml(read_text(path), path), "calibration", {"schema", "log", "height", "places"});
  top.require_schema(kCalibrationSchema);
  double height = 0.0;
  read_value(top, {.name = "height", .range = {0.2, 2.0}}, height);
  const std::filesystem::path log_path = std::filesystem::path(path).parent_path() / top.text("log");
  const std::vector<RecordedEstimate> log = read_person_log(log_path.string());
  std::vector<MarkedPlace> places;
  for (const YAML::Node& node : top.items("places"))
    places.push_back(read_place(path, node, places.size() + 1, height, log));
  return places;
}

CameraCalibration calibrate_camera(std::span<const MarkedPlace> places, const std::string& name) {
  const auto n = static_cast<Eigen::Index>(places.size());
  if (n < kLeastPlaces)
    throw InputError(
        fmt::format("{}: expected at least {} places where somebody stood, found {}", name, kLeastPlaces, n));
  if (const double off = aside(places); off < kLeastAside)
    throw InputError(
        fmt::format("{}: expected places that do not lie on one line, found {} within {:.2f} m of one (at "
                    "least {} m)",
                    name, n, off, kLeastAside));
  Eigen::Matrix3Xd p_C(3, n), p_B(3, n);
  for (Eigen::Index k = 0; k < n; ++k) {
    p_C.col(k) = places[static_cast<std::size_t>(k)].p_CP;
    p_B.col(k) = places[static_cast<std::size_t>(k)].p_BP;
  }
  const Eigen::Matrix4d T = Eigen::umeyama(p_C, p_B, false);
  CameraCalibration found;
  const Eigen::Matrix3d R = T.topLeftCorner<3, 3>();
  found.X_BC = {Eigen::Quaterniond(R).normalized(), T.topRightCorner<3, 1>()};
  const Eigen::Vector3d mean_C = p_C.rowwise().mean(), mean_B = p_B.rowwise().mean();
  found.scale = (p_B.colwise() - mean_B).norm() / (p_C.colwise() - mean_C).norm();

  Eigen::Matrix<double, 6, 6> information = Eigen::Matrix<double, 6, 6>::Zero();
  double squares = 0.0;
  for (Eigen::Index k = 0; k < n; ++k) {
    const Eigen::Vector3d turned = R * p_C.col(k);
    const double residual = (turned + found.X_BC.p - p_B.col(k)).norm();
    found.residuals.push_back(residual);
    squares += residual * residual;
    Eigen::Matrix<double, 3, 6> J;
    J << Eigen::Matrix3d::Identity(), -cross(turned);
    information += J.transpose() * J;
  }
  found.rms = std::sqrt(squares / static_cast<double>(n));
  const double variance = squares / static_cast<double>(3 * n - 6);
  const Eigen::Matrix<double, 6, 1> errors = (variance * information.inverse().diagonal()).cwiseMax(0.0).cwiseSqrt();
  found.position_error = errors.head<3>();
  found.rotation_error = errors.tail<3>();
  return found;
}

}  // namespace duet
