// Body models for tests: a few vertices whose joints are known.
#pragma once

#include <cmath>
#include <string>
#include <vector>

#include "duet/people/bodies/body_model.h"
#include "tests/people/body_files.h"

namespace duet::test {

// `joints` rows (24, 52 or 55) over twice as many vertices: joint k is 0.75 of vertex 2k and 0.25 of vertex 2k + 1.
struct SmallModel {
  int joints = 24;
  int shapes = 12;
  std::vector<double> v_template, shapedirs;

  explicit SmallModel(int joint_count) : joints(joint_count) {
    for (int v = 0; v < vertices(); ++v)
      for (int axis = 0; axis < 3; ++axis) {
        v_template.push_back(0.8 * std::sin(1.7 * v + axis));
        for (int b = 0; b < shapes; ++b) shapedirs.push_back(0.02 * std::cos(v + 2.0 * axis + 3.0 * b));
      }
  }
  [[nodiscard]] int vertices() const { return 2 * joints; }
  [[nodiscard]] double weight(int joint, int vertex) const {
    return vertex == 2 * joint ? 0.75 : vertex == 2 * joint + 1 ? 0.25 : 0.0;
  }
  [[nodiscard]] std::vector<double> regressor() const {
    std::vector<double> dense;
    for (int j = 0; j < joints; ++j)
      for (int v = 0; v < vertices(); ++v) dense.push_back(weight(j, v));
    return dense;
  }
  // Joint of the model at a shape.
  [[nodiscard]] Eigen::Vector3d joint(int j, const std::vector<double>& betas) const {
    Eigen::Vector3d p = Eigen::Vector3d::Zero();
    for (int v = 0; v < vertices(); ++v)
      for (int axis = 0; axis < 3; ++axis) {
        double x = v_template[3 * v + axis];
        for (int b = 0; b < 10; ++b) x += betas[b] * shapedirs[(3 * v + axis) * shapes + b];
        p[axis] += weight(j, v) * x;
      }
    return p;
  }
  [[nodiscard]] RestJoints rest(const std::vector<double>& betas) const {
    RestJoints out;
    const int left_hand = joints == 24 ? 22 : joints == 52 ? 25 : 28, right_hand = joints == 24 ? 23 : left_hand + 15;
    for (int j = 0; j < kSmplJoints; ++j) out.col(j) = joint(j == 22 ? left_hand : j == 23 ? right_hand : j, betas);
    return out;
  }

  [[nodiscard]] Npz npz() const {
    Npz npz;
    const auto V = static_cast<std::size_t>(vertices());
    npz.set("v_template", v_template, {V, 3});
    npz.set("shapedirs", shapedirs, {V, 3, static_cast<std::size_t>(shapes)});
    npz.set("J_regressor", regressor(), {static_cast<std::size_t>(joints), V});
    return npz;
  }

  enum class Matrix { kDense, kColumns, kRows };
  // Protocol 2, as the models' own files: `old` with the texts of Python 2.
  [[nodiscard]] std::string pickle(Matrix kind, bool old = false) const {
    PickleWriter out(2);
    const auto text = [&](const std::string& value) {
      if (old)
        out.raw("U").little(value.size(), 1).raw(value);
      else
        out.text(value);
    };
    out.raw("}(");
    text("v_template");
    if (old)
      old_array(out, {vertices(), 3}, v_template);
    else
      out.doubles({vertices(), 3}, v_template);
    text("shapedirs");
    out.doubles({vertices(), 3, shapes}, shapedirs);
    text("J_regressor");
    if (kind == Matrix::kDense)
      out.doubles({joints, vertices()}, regressor());
    else
      sparse(out, kind == Matrix::kColumns);
    return out.raw("u.").str();
  }

 private:
  // The bytes as a string of Python 2.
  static void old_array(PickleWriter& out, const std::vector<int>& shape, const std::vector<double>& values) {
    out.call("numpy.core.multiarray", "_reconstruct")
        .call("numpy", "ndarray")
        .integer(0)
        .raw(
            "\x85U\x01"
            "b\x87R(");
    out.integer(1).raw("(");
    for (const int size : shape) out.integer(size);
    const std::string bytes = PickleWriter::packed(values);
    out.raw("t").dtype("f8").raw("\x89T").little(bytes.size(), 4).raw(bytes).raw("tb");
  }
  void sparse(PickleWriter& out, bool by_column) const {
    std::vector<double> data;
    std::string indices, starts(4, '\0');
    const auto put = [](std::string& bytes, int value) {
      for (int i = 0; i < 4; ++i) bytes += static_cast<char>(value >> (8 * i));
    };
    const int lines = by_column ? vertices() : joints, places = by_column ? joints : vertices();
    for (int line = 0; line < lines; ++line) {
      for (int place = 0; place < places; ++place) {
        const double value = by_column ? weight(place, line) : weight(line, place);
        if (value == 0.0) continue;
        data.push_back(value);
        put(indices, place);
      }
      put(starts, static_cast<int>(data.size()));
    }
    const int count = static_cast<int>(data.size());
    out.raw(by_column ? "cscipy.sparse.csc\ncsc_matrix\n" : "cscipy.sparse._csr\ncsr_matrix\n").raw(")\x81}(");
    out.text("_shape").integer(joints).integer(vertices()).raw("\x86").text("data").doubles({count}, data);
    out.text("indices").array({count}, indices, "i4").text("indptr").array({lines + 1}, starts, "i4");
    out.text("maxprint").integer(50).raw("ub");
  }
};

}  // namespace duet::test
