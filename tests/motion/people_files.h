// Stand-ins for the files of data sets: two synthesised people written as each format has them, for tests and for
// examples/data/. The same clip gives the same bytes.
#pragma once

#include <cstring>
#include <functional>
#include <string>
#include <vector>

#include "duet/archives/npy/npy.h"
#include "duet/archives/npy/npz.h"
#include "duet/archives/zip/zip.h"
#include "tests/archives/pickle_bytes.h"
#include "tests/motion/people_standins.h"
#include "tests/people/bvh_text.h"

namespace duet::test {

struct StandinFile {
  std::string path;  // below the folder of the stand-in
  std::string bytes;
};

// One data set's files of one clip.
struct Standin {
  std::string name;                  // the folder in examples/data
  std::string format;                // of the table
  std::vector<std::string> paths;    // what a user names, below the folder; "" for the folder itself
  std::vector<std::string> options;  // of `duet import`, besides
  const char* layout;
  double rate_hz;
  std::vector<StandinFile> files;
};

inline constexpr int kStandinFrames = 8;

// (T, K, 3) of one person as an NPY file of f4 or f8, with more columns before and after where asked.
inline std::string npy_of(const std::string& type, const std::vector<std::size_t>& shape, const std::string& values,
                          const std::string& order = "False") {
  std::string sizes;
  for (const std::size_t size : shape) sizes += fmt::format("{}, ", size);
  std::string header = fmt::format("{{'descr': '{}', 'fortran_order': {}, 'shape': ({}), }}", type, order, sizes);
  while ((10 + header.size() + 1) % 64 != 0) header += ' ';
  header += '\n';
  std::string bytes("\x93NUMPY\x01\x00", 8);
  bytes += static_cast<char>(header.size() & 0xff);
  bytes += static_cast<char>(header.size() >> 8);
  return bytes + header + values;
}

inline std::string f4_npy(const std::vector<std::size_t>& shape, const std::vector<double>& values) {
  return npy_of("<f4", shape, PickleWriter::packed_floats(values));
}
inline std::string f4_npy(const PointTracks& tracks) {
  return f4_npy({static_cast<std::size_t>(tracks.frames()), static_cast<std::size_t>(tracks.points()), 3},
                tracks.data());
}

// The bytes that numpy.save makes of one Python object, whose opcodes `put` writes.
inline std::string object_npy(const std::function<void(PickleWriter&)>& put) {
  PickleWriter out(3);
  out.call("numpy.core.multiarray", "_reconstruct")
      .call("numpy", "ndarray")
      .integer(0)
      .raw("\x85")
      .bytes("b")
      .raw("\x87R(");
  out.integer(1).raw(")").call("numpy", "dtype").text("O8").raw("\x89\x88\x87R(").integer(3).text("|").raw("NNN");
  out.integer(-1).integer(-1).integer(63).raw("tb\x89](");
  put(out);
  out.raw("etb.");
  return npy_of("|O", {}, out.str());
}

// Both people's columns in a file's world, (T, 2, K, 3).
inline std::vector<double> both_people(const RawPeople& people) {
  std::vector<double> values;
  const int frames = people.joints[0].frames(), points = people.joints[0].points();
  for (int t = 0; t < frames; ++t)
    for (const PointTracks& tracks : people.joints) {
      const double* from = &tracks.data()[static_cast<std::size_t>(3 * t * points)];
      values.insert(values.end(), from, from + 3 * points);
    }
  return values;
}

inline Standin inter_x_standin() {
  const RawPeople people = standin_people(standin_clip(kStandinFrames, 120.0), joint_layout("optitrack-64"), y_up());
  const std::string clip = "skeletons/G001T000A001R000/";
  PickleWriter order(4);
  order.raw("}(").text("G001T000A001R000").integer(1).text("G001T000A001R001").integer(0).raw("u.");
  return {"inter_x",
          "inter-x-skeleton",
          {""},
          {},
          "optitrack-64",
          120.0,
          {{clip + "P1.npy", f4_npy(people.joints[0])},
           {clip + "P2.npy", f4_npy(people.joints[1])},
           {"annots/interaction_order.pkl", order.str()},
           {"splits/train.txt", "G001T000A001R000\n"}}};
}

inline Standin interhuman_standin() {
  const RawPeople people = standin_people(standin_clip(kStandinFrames, 30.0), joint_layout("smpl-22"));
  const auto row = [&](const PointTracks& tracks) {
    std::vector<double> values;
    for (int t = 0; t < tracks.frames(); ++t) {
      const double* from = &tracks.data()[static_cast<std::size_t>(t) * 66];
      values.insert(values.end(), from, from + 66);
      values.insert(values.end(), 492 - 66, 0.25);
    }
    return f4_npy({static_cast<std::size_t>(tracks.frames()), 492}, values);
  };
  return {"interhuman",
          "interhuman-processed",
          {""},
          {"--task", "handshake"},
          "smpl-22",
          30.0,
          {{"motions_processed/person1/7.npy", row(people.joints[0])},
           {"motions_processed/person2/7.npy", row(people.joints[1])}}};
}

inline Standin core4d_standin() {
  const RawPeople people = standin_people(standin_clip(kStandinFrames, 15.0 + 5.0), joint_layout("smplx-127"), y_up());
  const auto npz = [&](const PointTracks& tracks) {
    const std::string dict = object_npy([&](PickleWriter& out) {
      out.raw("}(").text("betas").array({tracks.frames(), 10},
                                        std::string(40 * static_cast<std::size_t>(tracks.frames()), '\0'), "f4");
      out.text("joints").array({tracks.frames(), 127, 3}, PickleWriter::packed_floats(tracks.data()), "f4").raw("u");
    });
    return zip_bytes({{"arr_0.npy", dict}});
  };
  std::vector<double> poses;
  for (int t = 0; t < kStandinFrames; ++t) {
    const Eigen::Vector3d p = people.joints[0].at(t, kRightWrist);
    poses.insert(poses.end(), {1, 0, 0, p.x(), 0, 1, 0, p.y(), 0, 0, 1, p.z(), 0, 0, 0, 1});
  }
  const std::string folder = "human_object_motions/20231002/004/";
  return {"core4d",
          "core4d",
          {""},
          {"--task", "handshake", "--rate", "20"},
          "smplx-127",
          20.0,
          {{folder + "person1_poses.npz", npz(people.joints[0])},
           {folder + "person2_poses.npz", npz(people.joints[1])},
           {folder + "smooth_objposes.npy", npy_of("<f8", {kStandinFrames, 4, 4}, PickleWriter::packed(poses))}}};
}

inline Standin harmony4d_standin() {
  const RawPeople people = standin_people(standin_clip(kStandinFrames, 20.0), joint_layout("coco-17"));
  Standin standin{"harmony4d", "harmony4d", {""}, {"--task", "handshake"}, "coco-17", 20.0, {}};
  for (int t = 0; t < kStandinFrames; ++t) {
    const auto points = [&](const PointTracks& tracks) {
      std::vector<double> values;
      for (int k = 0; k < 17; ++k) {
        const Eigen::Vector3d p = tracks.at(t, k);
        values.insert(values.end(), {p.x(), p.y(), p.z(), 0.9});
      }
      return values;
    };
    // B's name first: the order of a dict says nothing.
    standin.files.push_back({fmt::format("train/03_grappling/001_grappling/processed_data/poses3d/{:05d}.npy", t + 1),
                             object_npy([&](PickleWriter& out) {
                               out.raw("}(").text("aria02").doubles({17, 4}, points(people.joints[1]));
                               out.text("aria01").doubles({17, 4}, points(people.joints[0])).raw("u");
                             })});
  }
  return standin;
}

inline Standin hi4d_standin() {
  const RawPeople people = standin_people(standin_clip(kStandinFrames, 30.0), joint_layout("smpl-24"), y_up());
  Standin standin{"hi4d", "hi4d", {""}, {}, "smpl-24", 30.0, {}};
  Npz meta;
  meta.set("genders", std::vector<std::string>{"female", "male"});
  standin.files.push_back({"pair02/hug02/meta.npz", meta.bytes()});
  for (int t = 0; t < kStandinFrames; ++t) {
    std::vector<double> values;
    for (const PointTracks& tracks : people.joints) {
      const double* from = &tracks.data()[static_cast<std::size_t>(t) * 72];
      values.insert(values.end(), from, from + 72);
    }
    standin.files.push_back({fmt::format("pair02/hug02/smpl/{:06d}.npz", t + 11),
                             zip_bytes({{"joints_3d.npy", f4_npy({2, 24, 3}, values)},
                                        {"betas.npy", f4_npy({2, 10}, std::vector<double>(20, 0.0))}})});
  }
  return standin;
}

inline Standin chi3d_standin() {
  const RawPeople people = standin_people(standin_clip(kStandinFrames, 50.0), joint_layout("imar-25"));
  std::string json = "{\"joints3d_25\": [";
  for (const PointTracks& tracks : people.joints) {
    json += &tracks == &people.joints[0] ? "[" : ", [";
    for (int t = 0; t < tracks.frames(); ++t) {
      json += t == 0 ? "[" : ", [";
      for (int k = 0; k < 25; ++k)
        json += fmt::format("{}[{:.5f}, {:.5f}, {:.5f}]", k == 0 ? "" : ", ", tracks.at(t, k).x(), tracks.at(t, k).y(),
                            tracks.at(t, k).z());
      json += "]";
    }
    json += "]";
  }
  return {
      "chi3d", "chi3d", {""}, {}, "imar-25", 50.0, {{"chi3d/train/s02/joints3d_25/Handshake 3.json", json + "]}\n"}}};
}

// As SBU is kept: Kinect's fifteen joints, named; in millimetres here, 1.2 m over the floor, y up.
inline Standin kinect_standin() {
  FileWorld world = y_up(1000.0);
  world.p = {0.0, 0.0, 1.2};
  const JointLayout& layout = joint_layout("kinect-15");
  const RawPeople people = standin_people(standin_clip(kStandinFrames, 20.0), layout, world);
  Npz npz;
  npz.set("joints", layout.names);
  npz.set_number("rate_hz", 20.0);
  npz.set_text("label", "shaking_hands");
  npz.set("positions", both_people(people), {kStandinFrames, 2, 15, 3});
  return {"kinect", "positions", {"recording.npz"}, {}, "kinect-15", 20.0, {{"recording.npz", npz.bytes()}}};
}

inline Standin npy_standin() {
  const RawPeople people = standin_people(standin_clip(kStandinFrames, 60.0), joint_layout("kinect-25"));
  return {"npy",
          "positions",
          {"both.npy"},
          {"--task", "handshake", "--skeleton", "kinect-25", "--rate", "60"},
          "kinect-25",
          60.0,
          {{"both.npy", f4_npy({kStandinFrames, 2, 25, 3}, both_people(people))}}};
}

inline Standin npy_pair_standin() {
  const RawPeople people = standin_people(standin_clip(kStandinFrames, 60.0), joint_layout("smpl-24"), y_up());
  return {"npy_pair",
          "positions",
          {"one.npy", "two.npy"},
          {"--task", "handshake", "--rate", "60"},
          "smpl-24",
          60.0,
          {{"one.npy", f4_npy(people.joints[0])}, {"two.npy", f4_npy(people.joints[1])}}};
}

inline std::string csv_of(const RawPeople& people, const std::vector<int>& persons, double rate_hz) {
  std::string text = "time";
  for (const int who : persons)
    for (const std::string& joint : people.layout->names)
      for (const char axis : {'x', 'y', 'z'})
        text += fmt::format(",{}{}_{}", persons.size() == 1 ? "" : who == 0 ? "a_" : "b_", joint, axis);
  text += "\n";
  for (int t = 0; t < people.joints[0].frames(); ++t) {
    text += fmt::format("{:.5f}", t / rate_hz);
    for (const int who : persons)
      for (int k = 0; k < people.joints[0].points(); ++k) {
        const auto& tracks = people.joints[static_cast<std::size_t>(who)];
        text += fmt::format(",{:.5f},{:.5f},{:.5f}", tracks.at(t, k).x(), tracks.at(t, k).y(), tracks.at(t, k).z());
      }
    text += "\n";
  }
  return text;
}

inline Standin csv_standin() {
  const RawPeople people = standin_people(standin_clip(kStandinFrames, 30.0), joint_layout("coco-17"));
  return {"csv",
          "positions",
          {"both.csv"},
          {"--task", "handshake"},
          "coco-17",
          30.0,
          {{"both.csv", "# two people\n" + csv_of(people, {0, 1}, 30.0)}}};
}

inline Standin csv_pair_standin() {
  const RawPeople people = standin_people(standin_clip(kStandinFrames, 30.0), joint_layout("smpl-22"));
  return {"csv_pair",
          "positions",
          {"a.csv", "b.csv"},
          {"--task", "handshake"},
          "smpl-22",
          30.0,
          {{"a.csv", csv_of(people, {0}, 30.0)}, {"b.csv", csv_of(people, {1}, 30.0)}}};
}

// All but BVH, whose own writer is bvh_text.h.
inline std::vector<Standin> people_standins() {
  return {inter_x_standin(),  interhuman_standin(), core4d_standin(),  harmony4d_standin(),
          hi4d_standin(),     chi3d_standin(),      kinect_standin(),  npy_standin(),
          npy_pair_standin(), csv_standin(),        csv_pair_standin()};
}

// The files of examples/data: those of each stand-in in a folder of its name, and pairs of BVH files.
inline std::vector<StandinFile> example_files() {
  std::vector<StandinFile> files;
  for (const Standin& standin : people_standins())
    for (const StandinFile& file : standin.files) files.push_back({standin.name + "/" + file.path, file.bytes});
  for (const auto& [name, bones] : {std::pair<std::string, std::vector<BvhBone>>{"bvh_cmu", cmu_bones()},
                                    {"bvh_lafan1", lafan_bones()},
                                    {"bvh_xsens", xsens_bones()},
                                    {"bvh_biped", lafan_bones()},
                                    {"bvh_soma", soma_bones()}}) {
    BvhWriter writer{.bones = bones};
    if (name == "bvh_biped") writer.names = bvh_names_of_others().front().map();
    files.push_back({name + "/a.bvh", writer.text()});
    writer.root.z() = 1.5;
    writer.first_angles = {0, 180, 0};  // turned to face the other
    files.push_back({name + "/b.bvh", writer.text()});
  }
  return files;
}

}  // namespace duet::test
