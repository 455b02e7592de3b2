// Parameters of body models for tests, their joints by a second way, and stand-ins of the files that hold them.
#pragma once

#include <fmt/format.h>

#include <Eigen/Geometry>
#include <cmath>
#include <string>
#include <vector>

#include "duet/archives/npy/npz.h"
#include "duet/core/recording.h"
#include "duet/people/bodies/body_model.h"
#include "tests/archives/hdf5_bytes.h"
#include "tests/archives/pickle_bytes.h"
#include "tests/archives/torch_bytes.h"

namespace duet::test {

// Axis-angle [rad] and metres, frame by frame; every number is one of single precision.
struct BodyParameters {
  int frames = 0;
  int body_joints = 21;
  std::vector<double> root, body, translation, betas;
};

inline double single(double value) { return static_cast<double>(static_cast<float>(value)); }

// Somebody who turns and waves about `place`.
inline BodyParameters body_parameters(int frames, double seed, int body_joints = 21,
                                      const Eigen::Vector3d& place = Eigen::Vector3d::Zero()) {
  BodyParameters out{
      .frames = frames, .body_joints = body_joints, .root = {}, .body = {}, .translation = {}, .betas = {}};
  for (int t = 0; t < frames; ++t) {
    for (int i = 0; i < 3; ++i) {
      out.root.push_back(single(0.8 * std::sin(seed + 1.3 * i + 0.1 * t)));
      out.translation.push_back(single(place[i] + 0.05 * std::sin(2.0 * seed + i + 0.07 * t)));
    }
    for (int i = 0; i < 3 * body_joints; ++i) out.body.push_back(single(0.4 * std::sin(seed * (i + 1) + 0.05 * t)));
  }
  for (int b = 0; b < 10; ++b) out.betas.push_back(single(std::sin(seed + b)));
  return out;
}

// A person who stands at `place` and holds the right hand out, in the middle furthest. `turn` brings the model's axes
// (x to the left, y up, z forward) into the file's.
inline BodyParameters standing_parameters(int frames, const Eigen::Quaterniond& turn, const Eigen::Vector3d& place,
                                          int body_joints = 21) {
  BodyParameters out = body_parameters(frames, 0.3, body_joints);
  const Eigen::AngleAxisd root(turn);
  for (double& value : out.body) value = single(0.05 * value);
  for (int t = 0; t < frames; ++t) {
    for (int i = 0; i < 3; ++i) {
      out.root[3 * t + i] = single(root.angle() * root.axis()[i]);
      out.translation[3 * t + i] = single(place[i]);
    }
    const double lift = 0.5 * (1.0 - std::cos(2.0 * EIGEN_PI * t / (frames - 1)));  // 0, 1 in the middle, 0
    double* left = &out.body[3 * (static_cast<std::size_t>(body_joints) * t + kLeftShoulder - 1)];
    double* right = left + 3 * (kRightShoulder - kLeftShoulder);
    left[0] = left[1] = right[0] = 0.0;
    left[2] = -single(1.3);         // hangs
    right[1] = single(1.4 * lift);  // forward
    right[2] = single(1.3 * (1.0 - lift));
  }
  return out;
}

struct PosedBody {
  std::vector<RestJoints> joints;
  std::vector<Eigen::Matrix3d> rotations;  // T * 24
};

// By homogeneous transforms from each joint to the root and back: not the way of body_model.cpp.
inline PosedBody posed(const BodyParameters& body, const RestJoints& rest) {
  PosedBody out;
  const auto matrix = [](const double* v) {
    const Eigen::Vector3d axis_angle(v[0], v[1], v[2]);
    const double angle = axis_angle.norm();
    return angle == 0.0 ? Eigen::Matrix3d(Eigen::Matrix3d::Identity())
                        : Eigen::AngleAxisd(angle, axis_angle / angle).toRotationMatrix();
  };
  for (int t = 0; t < body.frames; ++t) {
    RestJoints joints;
    for (int j = 0; j < kSmplJoints; ++j) {
      Eigen::Matrix4d X = Eigen::Matrix4d::Identity();
      for (int k = j; k >= 0; k = kSmplParents[k]) {  // from the joint up to the root
        Eigen::Matrix4d local = Eigen::Matrix4d::Identity();
        if (k == 0)
          local.topLeftCorner<3, 3>() = matrix(&body.root[3 * t]);
        else if (k <= body.body_joints)
          local.topLeftCorner<3, 3>() =
              matrix(&body.body[3 * (static_cast<std::size_t>(body.body_joints) * t + k - 1)]);
        const Eigen::Vector3d from =
            k == 0 ? Eigen::Vector3d(Eigen::Vector3d::Zero()) : Eigen::Vector3d(rest.col(kSmplParents[k]));
        local.topRightCorner<3, 1>() = rest.col(k) - from;
        X = local * X;
      }
      joints.col(j) = X.topRightCorner<3, 1>() + Eigen::Map<const Eigen::Vector3d>(&body.translation[3 * t]);
      out.rotations.push_back(X.topLeftCorner<3, 3>());
    }
    out.joints.push_back(joints);
  }
  return out;
}

// ---- stand-ins of files ------------------------------------------------------------

inline std::vector<std::size_t> sizes(int rows, int columns) {
  return {static_cast<std::size_t>(rows), static_cast<std::size_t>(columns)};
}

inline Npz inter_x_npz(const BodyParameters& body, bool flat = false) {
  Npz npz;
  const auto T = static_cast<std::size_t>(body.frames);
  npz.set("root_orient", body.root, sizes(body.frames, 3));
  npz.set("pose_body", body.body, flat ? sizes(body.frames, 63) : std::vector<std::size_t>{T, 21, 3});
  npz.set("pose_lhand", std::vector<double>(T * 45), {T, 15, 3});
  npz.set("pose_rhand", std::vector<double>(T * 45), {T, 15, 3});
  npz.set("trans", body.translation, sizes(body.frames, 3));
  npz.set("betas", body.betas, {1, 10});
  npz.set_text("gender", "neutral");
  return npz;
}

// One array of Inter-X in HDF5, hands and face as at rest.
inline std::vector<double> inter_x_h5_values(const BodyParameters& a, const BodyParameters& b) {
  std::vector<double> values(static_cast<std::size_t>(a.frames) * 56 * 6);
  for (int t = 0; t < a.frames; ++t)
    for (const auto& [first, body] : {std::pair{0, &a}, std::pair{3, &b}})
      for (int i = 0; i < 3; ++i) {
        double* const frame = &values[static_cast<std::size_t>(t) * 56 * 6];
        frame[first + i] = body->root[3 * t + i];
        frame[55 * 6 + first + i] = body->translation[3 * t + i];
        for (int j = 0; j < 21; ++j) frame[(1 + j) * 6 + first + i] = body->body[63 * t + 3 * j + i];
      }
  return values;
}

inline std::string inter_x_h5(const std::string& clip, const BodyParameters& a, const BodyParameters& b) {
  return Hdf5Writer::bytes(
      {{.name = clip, .shape = {static_cast<std::uint64_t>(a.frames), 56, 6}, .values = inter_x_h5_values(a, b)}});
}

inline std::string interhuman_pickle(const BodyParameters& a, const BodyParameters& b, int protocol = 4,
                                     double rate_hz = 0.0) {
  PickleWriter out(protocol);
  out.raw("}(");
  if (rate_hz > 0.0) out.text("mocap_framerate").real(rate_hz);
  for (const auto& [key, body] : {std::pair{"person1", &a}, std::pair{"person2", &b}}) {
    out.text(key).raw("}(");
    out.text("trans").doubles({body->frames, 3}, body->translation);
    out.text("root_orient").doubles({body->frames, 3}, body->root);
    out.text("pose_body").doubles({body->frames, 63}, body->body);
    out.text("betas").doubles({10}, body->betas).raw("u");
  }
  return out.raw("u.").str();
}

inline Npz amass_poses_npz(const BodyParameters& body, double rate_hz = 120.0, bool second_spelling = false) {
  std::vector<double> poses;
  for (int t = 0; t < body.frames; ++t) {
    poses.insert(poses.end(), body.root.begin() + 3 * t, body.root.begin() + 3 * t + 3);
    poses.insert(poses.end(), body.body.begin() + 63 * t, body.body.begin() + 63 * t + 63);
    poses.resize(poses.size() + 90);
  }
  Npz npz;
  npz.set("poses", std::move(poses), sizes(body.frames, 156));
  npz.set("trans", body.translation, sizes(body.frames, 3));
  std::vector<double> betas = body.betas;
  betas.resize(16);
  npz.set("betas", std::move(betas), {16});
  npz.set_number(second_spelling ? "mocap_frame_rate" : "mocap_framerate", rate_hz);
  return npz;
}

inline Npz amass_stageii_npz(const BodyParameters& body, double rate_hz = 120.0) {
  Npz npz;
  const auto T = static_cast<std::size_t>(body.frames);
  npz.set("root_orient", body.root, sizes(body.frames, 3));
  npz.set("pose_body", body.body, sizes(body.frames, 63));
  npz.set("pose_hand", std::vector<double>(T * 90), sizes(body.frames, 90));
  npz.set("trans", body.translation, sizes(body.frames, 3));
  npz.set("betas", body.betas, {10});
  npz.set_number("mocap_frame_rate", rate_hz);
  npz.set_text("surface_model_type", "smplx");
  return npz;
}

// Rows of `width` numbers of single precision with root, body, translation and (from 0 on: none) betas at these places.
inline std::string rows_npy(const BodyParameters& body, int width, int root, int pose, int translation, int betas) {
  std::vector<double> values(static_cast<std::size_t>(body.frames) * width);
  for (int t = 0; t < body.frames; ++t) {
    double* row = &values[static_cast<std::size_t>(t) * width];
    for (int i = 0; i < 3; ++i) row[root + i] = body.root[3 * t + i];
    for (int i = 0; i < 3; ++i) row[translation + i] = body.translation[3 * t + i];
    for (int i = 0; i < 63; ++i) row[pose + i] = body.body[63 * t + i];
    for (int i = 0; i < 10 && betas >= 0; ++i) row[betas + i] = body.betas[i];
  }
  std::string dictionary =
      fmt::format("{{'descr': '<f4', 'fortran_order': False, 'shape': ({}, {}), }}", body.frames, width);
  dictionary += std::string(63 - (10 + dictionary.size()) % 64, ' ') + "\n";
  return std::string("\x93NUMPY\x01\x00", 8) + static_cast<char>(dictionary.size()) + '\0' + dictionary +
         PickleWriter::packed_floats(values);
}
inline std::string motion_x_npy(const BodyParameters& body) { return rows_npy(body, 322, 0, 3, 309, 312); }
inline std::string phuma_npy(const BodyParameters& body) { return rows_npy(body, 69, 3, 6, 0, -1); }

// As GVHMR writes it: the translation lies in memory column by column, betas once a frame.
inline std::string gvhmr_pt(const BodyParameters& body, const std::string& key = "smpl_params_global") {
  std::vector<double> betas;
  for (int t = 0; t < body.frames; ++t) betas.insert(betas.end(), body.betas.begin(), body.betas.end());
  TorchWriter out;
  out.pickle.raw("}(").text(key).raw("}(").text("body_pose");
  out.floats(body.frames, 63, body.body);
  out.pickle.text("betas");
  out.floats(body.frames, 10, betas);
  out.pickle.text("global_orient");
  out.floats(body.frames, 3, body.root);
  out.pickle.text("transl");
  out.floats(body.frames, 3, body.translation, true);
  out.pickle.raw("u").text("K_fullimg").none().raw("u.");
  return out.str();
}

// People with the frames of the video in which each was seen.
struct TrackedBody {
  int id = 0;
  int first_frame = 0;
  BodyParameters body;
};

inline std::string wham_pkl(const std::vector<TrackedBody>& people) {
  PickleWriter out;
  out.call("collections", "defaultdict").call("builtins", "dict").raw("\x85R(");
  for (const TrackedBody& person : people) {
    std::vector<double> pose, frames;
    std::string frame_ids;
    for (int t = 0; t < person.body.frames; ++t) {
      pose.insert(pose.end(), person.body.root.begin() + 3 * t, person.body.root.begin() + 3 * t + 3);
      pose.insert(pose.end(), person.body.body.begin() + 69 * t, person.body.body.begin() + 69 * t + 69);
      for (int i = 0; i < 8; ++i) frame_ids += static_cast<char>(i < 4 ? (person.first_frame + t) >> (8 * i) : 0);
    }
    const int T = person.body.frames;
    out.integer(person.id).raw("}(");
    out.text("pose").joblib_array({T, 72}, PickleWriter::packed_floats(pose), "f4");
    out.text("pose_world").joblib_array({T, 72}, PickleWriter::packed_floats(pose), "f4");
    out.text("trans_world").joblib_array({T, 3}, PickleWriter::packed_floats(person.body.translation), "f4");
    out.text("betas").joblib_array({1, 10}, PickleWriter::packed_floats(person.body.betas), "f4");
    out.text("frame_ids").joblib_array({T}, frame_ids, "i8").raw("u");
  }
  return out.raw("u.").str();
}

// Rotation matrices, and each frame's people in the order of their numbers.
inline std::string phalp_pkl(const std::vector<TrackedBody>& people, int frames) {
  PickleWriter out;
  out.raw("}(");
  const auto matrix = [](const double* v) {
    Eigen::Matrix<double, 3, 3, Eigen::RowMajor> R =
        rotation_of_vector(Eigen::Vector3d(v[0], v[1], v[2])).toRotationMatrix();
    return std::vector<double>(R.data(), R.data() + 9);
  };
  const auto put = [&](const std::vector<int>& shape, const std::vector<double>& values) -> PickleWriter& {
    return out.joblib_array(shape, PickleWriter::packed_floats(values), "f4");
  };
  for (int f = 0; f < frames; ++f) {
    std::vector<const TrackedBody*> seen;
    for (const TrackedBody& person : people)
      if (f >= person.first_frame && f < person.first_frame + person.body.frames) seen.push_back(&person);
    out.text("frames/" + std::to_string(100000 + f) + ".jpg").raw("}(").text("tid").raw("](");
    for (const TrackedBody* person : seen) out.integer(person->id);
    out.raw("e").text("smpl").raw("](");
    for (const TrackedBody* person : seen) {
      const int t = f - person->first_frame;
      std::vector<double> body;
      for (int j = 0; j < 23; ++j)
        for (const double value : matrix(&person->body.body[3 * (23 * t + j)])) body.push_back(value);
      out.raw("}(").text("global_orient");
      put({1, 3, 3}, matrix(&person->body.root[3 * t])).text("body_pose");
      put({23, 3, 3}, body).text("betas");
      put({10}, person->body.betas).raw("u");
    }
    out.raw("e").text("camera").raw("](");
    for (const TrackedBody* person : seen) {
      const double* p = &person->body.translation[3 * (f - person->first_frame)];
      put({3}, {p[0], p[1], p[2]});
    }
    out.raw("eu");
  }
  return out.raw("u.").str();
}

}  // namespace duet::test
