#include "duet/people/bodies/body_model.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <array>
#include <chrono>
#include <cmath>
#include <filesystem>
#include <optional>

#include "duet/archives/npy/npz.h"
#include "duet/archives/pickle/pickle_machine.h"
#include "duet/core/file.h"
#include "duet/core/require.h"
#include "duet/motion/people/made_up.h"
#include "duet/people/bodies/number_table.h"
#include "duet/tasks/synthesis/posed_body.h"

namespace duet {
namespace {

constexpr std::size_t kShapes = 10;
constexpr double kSmallestSpan = 0.5, kLargestSpan = 3.0;  // of all rest joints, largest extent [m]
constexpr std::string_view kCacheSuffix = ".duet-joints.npz";

struct Kind {
  std::string_view name;
  std::size_t joints;
  int left_hand, right_hand;  // of its joints
};
constexpr std::array<Kind, 3> kKinds = {{{"SMPL", 24, 22, 23}, {"SMPL-H", 52, 25, 40}, {"SMPL-X", 55, 28, 43}}};

// The content of the file.
struct Regression {
  NumberTable v_template;  // (V, 3)
  NumberTable shapedirs;   // (V, 3, B)
  std::size_t joints = 0;
  std::vector<std::size_t> row = {};  // entries of the regressor that are not 0
  std::vector<std::size_t> column = {};
  std::vector<double> weight = {};
};

const Kind& kind_of(const std::string& path, std::size_t joints) {
  for (const Kind& kind : kKinds)
    if (kind.joints == joints) return kind;
  throw InputError(fmt::format(
      "'{}': key 'J_regressor': expected 24 (SMPL), 52 (SMPL-H) or 55 (SMPL-X) joints, found {}", path, joints));
}

void take_dense(Regression& model, const NumberTable& regressor) {
  if (regressor.shape.size() != 2 || regressor.shape[1] != model.v_template.shape[0])
    regressor.fail(fmt::format("expected shape (joints, {}), found {}", model.v_template.shape[0], regressor.found()));
  model.joints = regressor.shape[0];
  for (std::size_t i = 0; i < regressor.values.size(); ++i) {
    if (regressor.values[i] == 0.0) continue;
    model.row.push_back(i / regressor.shape[1]);
    model.column.push_back(i % regressor.shape[1]);
    model.weight.push_back(regressor.values[i]);
  }
}

std::size_t index_at(const NumberTable& table, std::size_t place, std::size_t most) {
  const double value = table.values[place];
  if (!(value >= 0.0 && value <= static_cast<double>(most) && value == std::floor(value)))
    table.fail(fmt::format("expected a whole number of 0 to {} at {}, found {}", most, place, value));
  return static_cast<std::size_t>(value);
}

// scipy.sparse: rows of one column after the other (CSC), or columns of one row after the other (CSR).
void take_sparse(Regression& model, const Pickle& pickle, const PickleNode& matrix) {
  const auto part = [&](const std::string& key) {
    const PickleNode* node = pickle.find(matrix, key);
    if (node == nullptr) pickle.fail(matrix.offset, fmt::format("key 'J_regressor': no member '{}'", key));
    return table_of(pickle, *node, "key 'J_regressor." + key + "'");
  };
  const PickleNode* shape = pickle.find(matrix, "_shape");
  if (shape == nullptr) shape = pickle.find(matrix, "shape");
  if (shape == nullptr || shape->kind != PickleKind::kTuple || shape->items.size() != 2)
    pickle.fail(matrix.offset, "key 'J_regressor': expected a shape of two sizes");
  const bool by_column = matrix.text == "csc_matrix";
  const std::size_t vertices = model.v_template.shape[0];
  const auto size = [&](int which) { return pickle[shape->items[which]].integer; };
  if (size(1) != static_cast<std::int64_t>(vertices) || size(0) < 1 || size(0) > 1000)
    pickle.fail(matrix.offset, fmt::format("key 'J_regressor': expected shape (joints, {}), found ({}, {})", vertices,
                                           size(0), size(1)));
  model.joints = static_cast<std::size_t>(size(0));
  const NumberTable data = part("data"), indices = part("indices"), starts = part("indptr");
  const std::size_t lines = by_column ? vertices : model.joints, places = by_column ? model.joints : vertices;
  if (starts.values.size() != lines + 1 || indices.values.size() != data.values.size())
    pickle.fail(matrix.offset,
                fmt::format("key 'J_regressor': {} values, {} indices and {} starts do not make a matrix",
                            data.values.size(), indices.values.size(), starts.values.size()));
  for (std::size_t line = 0; line < lines; ++line)
    for (std::size_t i = index_at(starts, line, data.values.size()); i < index_at(starts, line + 1, data.values.size());
         ++i) {
      const std::size_t place = index_at(indices, i, places - 1);
      model.row.push_back(by_column ? place : line);
      model.column.push_back(by_column ? line : place);
      model.weight.push_back(data.values[i]);
    }
}

void check_shapes(const NumberTable& v_template, const NumberTable& shapedirs) {
  if (v_template.shape.size() != 2 || v_template.shape[1] != 3)
    v_template.fail(fmt::format("expected shape (V, 3), found {}", v_template.found()));
  if (shapedirs.shape.size() != 3 || shapedirs.shape[0] != v_template.shape[0] || shapedirs.shape[1] != 3)
    shapedirs.fail(fmt::format("expected shape ({}, 3, B), found {}", v_template.shape[0], shapedirs.found()));
}

Regression regression_of(const Npz& npz) {
  Regression model{.v_template = table_of(npz, "v_template"), .shapedirs = table_of(npz, "shapedirs")};
  check_shapes(model.v_template, model.shapedirs);
  take_dense(model, table_of(npz, "J_regressor"));
  return model;
}

Regression regression_of(const Pickle& pickle) {
  const PickleNode& root = pickle[pickle.root];
  const auto get = [&](const std::string& key) -> const PickleNode& {
    if (const PickleNode* node = pickle.find(root, key)) return *node;
    pickle.fail(root.offset, fmt::format("expected a dict with the key '{}' of a body model, found {}", key,
                                         root.kind == PickleKind::kDict ? "none" : to_string(root.kind)));
  };
  Regression model{.v_template = table_of(pickle, get("v_template"), "key 'v_template'"),
                   .shapedirs = table_of(pickle, get("shapedirs"), "key 'shapedirs'")};
  check_shapes(model.v_template, model.shapedirs);
  const PickleNode& regressor = get("J_regressor");
  if (regressor.kind == PickleKind::kObject)
    take_sparse(model, pickle, regressor);
  else
    take_dense(model, table_of(pickle, regressor, "key 'J_regressor'"));
  return model;
}

// J_regressor applied to column `shape` of each vertex's coordinates, `stride` numbers apart.
Eigen::Matrix3Xd regressed(const Regression& model, const std::vector<double>& values, std::size_t stride,
                           std::size_t shape) {
  Eigen::Matrix3Xd joints = Eigen::Matrix3Xd::Zero(3, static_cast<Eigen::Index>(model.joints));
  for (std::size_t i = 0; i < model.weight.size(); ++i)
    for (std::size_t axis = 0; axis < 3; ++axis)
      joints(static_cast<Eigen::Index>(axis), static_cast<Eigen::Index>(model.row[i])) +=
          model.weight[i] * values[(3 * model.column[i] + axis) * stride + shape];
  return joints;
}

RestJoints smpl_of(const Eigen::Matrix3Xd& joints, const Kind& kind) {
  RestJoints smpl;
  smpl.leftCols<22>() = joints.leftCols<22>();
  smpl.col(kLeftHand) = joints.col(kind.left_hand);
  smpl.col(kRightHand) = joints.col(kind.right_hand);
  return smpl;
}

BodyModel derived(const Regression& regression, const std::string& path) {
  const Kind& kind = kind_of(path, regression.joints);
  BodyModel model{.kind = std::string(kind.name),
                  .joints = smpl_of(regressed(regression, regression.v_template.values, 1, 0), kind)};
  const std::size_t shapes = regression.shapedirs.shape[2];
  for (std::size_t b = 0; b < std::min(shapes, kShapes); ++b)
    model.dirs.push_back(smpl_of(regressed(regression, regression.shapedirs.values, shapes, b), kind));
  const double span = (model.joints.rowwise().maxCoeff() - model.joints.rowwise().minCoeff()).maxCoeff();
  if (!(span >= kSmallestSpan && span <= kLargestSpan))
    throw InputError(
        fmt::format("'{}': expected the joints of a person in metres, found {:.3g} m from end to end", path, span));
  return model;
}

// ---- what is kept beside the user's file ------------------------------------------------------------

struct FileMark {
  std::int64_t bytes = 0;
  std::int64_t time = 0;
};

FileMark mark_of(const std::string& path) {
  std::error_code error;
  FileMark mark;
  mark.bytes = static_cast<std::int64_t>(std::filesystem::file_size(path, error));
  if (error) return {};
  const auto time = std::filesystem::last_write_time(path, error);
  mark.time = std::chrono::duration_cast<std::chrono::nanoseconds>(time.time_since_epoch()).count();
  return mark;
}

BodyModel model_of_joints(const Npz& npz) {
  BodyModel model{.kind = npz.contains("kind") ? npz.text("kind") : "SMPL", .joints = {}};
  const std::vector<double> joints = npz.numbers("J_template", {kSmplJoints, 3});
  model.joints = Eigen::Map<const RestJoints>(joints.data());
  const NumberTable dirs = table_of(npz, "J_shapedirs");
  if (dirs.shape.size() != 3 || dirs.shape[0] != kSmplJoints || dirs.shape[1] != 3)
    dirs.fail(fmt::format("expected shape (24, 3, B), found {}", dirs.found()));
  for (std::size_t b = 0; b < std::min(dirs.shape[2], kShapes); ++b) {
    RestJoints dir;
    for (Eigen::Index i = 0; i < dir.size(); ++i) dir.data()[i] = dirs.values[i * dirs.shape[2] + b];
    model.dirs.push_back(dir);
  }
  return model;
}

std::optional<BodyModel> kept(const std::string& path, const FileMark& mark) {
  const std::string cache = path + std::string(kCacheSuffix);
  if (!std::filesystem::exists(cache)) return std::nullopt;
  try {
    const Npz npz = Npz::load(cache);
    if (npz.integer("source_bytes") != mark.bytes || npz.integer("source_time") != mark.time) return std::nullopt;
    return model_of_joints(npz);
  } catch (const InputError&) {
    return std::nullopt;  // damaged, or of another version: derived again
  }
}

void keep(const BodyModel& model, const std::string& path, const FileMark& mark) {
  const std::size_t shapes = model.dirs.size();
  std::vector<double> dirs(kSmplJoints * 3 * shapes);
  for (std::size_t b = 0; b < shapes; ++b)
    for (std::size_t i = 0; i < kSmplJoints * 3; ++i) dirs[i * shapes + b] = model.dirs[b].data()[i];
  Npz npz;
  npz.set("J_template", std::vector<double>(model.joints.data(), model.joints.data() + model.joints.size()),
          {kSmplJoints, 3});
  npz.set("J_shapedirs", std::move(dirs), {kSmplJoints, 3, shapes});
  npz.set_text("kind", model.kind);
  npz.set_integer("source_bytes", mark.bytes);
  npz.set_integer("source_time", mark.time);
  npz.save(path + std::string(kCacheSuffix));
}

std::optional<BodyModel> with_joints(const std::string& path, std::string_view bytes) {
  const Npz npz = Npz::parse(bytes, path, {"J_template", "J_shapedirs", "kind"});
  if (!npz.contains("J_template")) return std::nullopt;
  return model_of_joints(npz);
}

}  // namespace

BodyModel load_body_model(const std::string& path) {
  const FileMark mark = mark_of(path);
  const std::string name = excerpt(std::filesystem::path(path).filename().string());
  if (std::optional<BodyModel> model = kept(path, mark)) {
    model->note = fmt::format("body model: {} of '{}' (joints kept beside it)", model->kind, name);
    return *std::move(model);
  }
  const std::string bytes = read_data(path);
  const bool is_archive = bytes.starts_with("PK");
  if (std::optional<BodyModel> model = is_archive ? with_joints(path, bytes) : std::nullopt) {
    model->note = fmt::format("body model: {} of '{}' (its joints)", model->kind, name);
    return *std::move(model);
  }
  BodyModel model =
      derived(is_archive ? regression_of(Npz::parse(bytes, path, {"v_template", "shapedirs", "J_regressor"}))
                         : regression_of(parse_pickle(bytes, path, PickleFlavour::kModel)),
              path);
  model.note = fmt::format("body model: {} of '{}', {} shape parameters", model.kind, name, model.dirs.size());
  try {
    keep(model, path, mark);
  } catch (const StorageError&) {
    model.note += " (its joints are not kept: the folder takes no file)";
  }
  return model;
}

BodyModel average_body() {
  const synthesis::Body body = synthesis::make_body(kAverageStature, {});
  BodyModel model{.kind = "", .joints = RestJoints::Zero()};
  for (int j = 1; j < kSmplJoints; ++j) {
    const Eigen::Vector3d& offset = body.offset[j];  // forward, left, up
    model.joints.col(j) = model.joints.col(kSmplParents[j]) + Eigen::Vector3d(offset.y(), offset.z(), offset.x());
  }
  model.note = fmt::format(
      "no body model: an average skeleton of {:.2f} m with duet's own proportions; shapes are not used, and heights "
      "are "
      "counted from the pelvis",
      kAverageStature);
  return model;
}

RestJoints rest_joints(const BodyModel& model, std::span<const double> betas) {
  RestJoints joints = model.joints;
  for (std::size_t b = 0; b < std::min(model.dirs.size(), betas.size()); ++b) joints += betas[b] * model.dirs[b];
  return joints;
}

namespace {

// 1/(2n)! and 1/(2n+1)!, signs alternating: cos x and sin(x)/x as polynomials of x^2. Up to x = pi/2 (a turn of pi) the
// first term that is left out is below 1e-17.
constexpr int kTerms = 12;
constexpr double kLargestSquare = 2.4675;  // (pi/2)^2, rounded up

constexpr std::array<double, kTerms> series(int first) {
  std::array<double, kTerms> terms{};
  double factorial = 1.0;
  for (int n = 0, k = 1; n < kTerms; ++n) {
    for (; k <= 2 * n + first; ++k) factorial *= k;
    terms[n] = (n % 2 == 0 ? 1.0 : -1.0) / factorial;
  }
  return terms;
}
constexpr std::array<double, kTerms> kCosine = series(0), kSineOverX = series(1);

}  // namespace

Eigen::Quaterniond rotation_of_vector(const Eigen::Vector3d& axis_angle) {
  const double square = 0.25 * axis_angle.squaredNorm();  // of half the angle
  if (!(square <= kLargestSquare)) {
    const double angle = axis_angle.norm();
    const Eigen::Vector3d sine = std::sin(0.5 * angle) / angle * axis_angle;
    return {std::cos(0.5 * angle), sine.x(), sine.y(), sine.z()};
  }
  double cosine = kCosine[kTerms - 1], ratio = kSineOverX[kTerms - 1];
  for (int n = kTerms - 2; n >= 0; --n) {
    cosine = cosine * square + kCosine[n];
    ratio = ratio * square + kSineOverX[n];
  }
  ratio *= 0.5;
  return {cosine, ratio * axis_angle.x(), ratio * axis_angle.y(), ratio * axis_angle.z()};
}

void pose_body(const RestJoints& rest, const Eigen::Vector3d& translation, std::span<Eigen::Quaterniond> rotations,
               PointTracks::Frame joints) {
  joints.col(kPelvis) = rest.col(kPelvis) + translation;
  for (int j = 1; j < kSmplJoints; ++j) {
    const int parent = kSmplParents[j];  // comes before j
    joints.col(j) = joints.col(parent) + rotations[parent] * (rest.col(j) - rest.col(parent));
    rotations[j] = rotations[parent] * rotations[j];
  }
}

}  // namespace duet
