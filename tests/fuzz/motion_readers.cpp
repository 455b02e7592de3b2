// Motions of people and robots: BVH, pickles, clips, paired motions, data sets of two people.
#include <filesystem>
#include <fstream>

#include "duet/archives/pickle/pickle_fields.h"
#include "duet/motion/carried_object.h"
#include "duet/motion/interaction_clip.h"
#include "duet/motion/paired_motion.h"
#include "duet/people/bvh/bvh.h"
#include "duet/people/formats/people_formats.h"
#include "tests/archives/pickle_bytes.h"
#include "tests/fuzz/archive_edit.h"
#include "tests/fuzz/reader.h"
#include "tests/motion/people.h"
#include "tests/motion/people_files.h"
#include "tests/people/bvh_text.h"

namespace duet::fuzz {
namespace {

std::string bvh_sample(unsigned /*seed*/) {
  test::BvhWriter writer;
  writer.frames = 3;
  return writer.text();
}

// Also the import of a pair of the same person.
void read_bvh_pair(std::string_view bytes) {
  const Bvh bvh = parse_bvh(bytes, "fuzz.bvh");
  (void)import_bvh_pair(bvh, bvh, Task::kHandshake);
}

std::string pickle_sample(unsigned /*seed*/) {
  test::PickleWriter out(4);
  out.raw("}(").text("fps").real(30.0);
  out.text("root_pos").doubles({2, 3}, {0, 0, 0.8, 0.1, 0, 0.8});
  out.text("root_rot").doubles({2, 4}, {0, 0, 0, 1, 0, 0, 0.6, 0.8});
  out.text("dof_pos").doubles({2, 2}, {0.1, 0.2, 0.3, 0.4});
  out.text("local_body_pos").none();
  out.text("link_body_list").raw("](").text("pelvis").raw("eu.");
  return out.str();
}

void read_pickle(std::string_view bytes) { (void)parse_motion_pickle(bytes, "fuzz.pkl"); }

std::string good_clip() {
  InteractionClip clip = test::two_people(3);
  clip.phases = {.act_begin = 1, .act_end = 2};
  clip.contacts = {{.begin = 1, .end = 2, .joint_a = 22, .joint_b = 23}};
  clip.object = {.poses = std::vector<Pose>(3), .keypoints = Eigen::Matrix3Xd::Zero(3, 2)};
  return clip_bytes(clip);
}

std::string clip_sample(unsigned seed) { return seed % 2 == 0 ? good_clip() : std::string(kEdit); }

void read_clip(std::string_view bytes) {
  static const Npz sample = Npz::parse(good_clip(), "sample");
  (void)clip_bytes(mirrored(parse_clip(archive_of(sample, bytes), "fuzz.npz")));  // what was read can be written
}

std::string good_paired_motion() {
  PairedMotion motion;
  motion.clip_id = "x";
  motion.phases = {.act_begin = 1, .act_end = 2};
  motion.robot.joint_names = {"a", "b"};
  motion.robot.root.resize(3);
  motion.robot.q = Eigen::MatrixXd::Zero(2, 3);
  motion.partner = test::moving_person(3, 50.0, {1, 0, 0});
  motion.source_partner = motion.partner;
  motion.source_reactor = test::moving_person(3, 50.0, {0, 0, 0});
  motion.reshaped = PointTracks(3, 16);
  motion.loss = {{"total", {2.0, 1.0}}};
  motion.settings = {{"mode", "paper"}};
  motion.object = {.poses = std::vector<Pose>(3), .keypoints = Eigen::Matrix3Xd::Zero(3, 2)};
  return paired_motion_bytes(motion);
}

std::string paired_motion_sample(unsigned seed) { return seed % 2 == 0 ? good_paired_motion() : std::string(kEdit); }

void read_paired_motion(std::string_view bytes) {
  static const Npz sample = Npz::parse(good_paired_motion(), "sample");
  (void)paired_motion_bytes(parse_paired_motion(archive_of(sample, bytes), "fuzz.npz"));
}

// ---- two people in files of others: the stand-ins of tests/motion/people_files.h, the first file damaged
// --------------

std::string people_sample(const test::Standin& standin, std::size_t file) { return standin.files.at(file).bytes; }

void read_people(const test::Standin& standin, std::size_t file, std::string_view bytes) {
  const std::string folder = scratch_folder() + "/" + standin.name;
  for (std::size_t i = 0; i < standin.files.size(); ++i) {
    const std::string path = folder + "/" + standin.files[i].path;
    if (i != file && std::filesystem::exists(path)) continue;
    std::filesystem::create_directories(std::filesystem::path(path).parent_path());
    std::ofstream out(path, std::ios::binary | std::ios::trunc);  // no sync: this is done ten thousand times
    out << (i == file ? bytes : std::string_view(standin.files[i].bytes));
  }
  std::vector<std::string> paths;
  for (const std::string& path : standin.paths) paths.push_back(folder + (path.empty() ? "" : "/" + path));
  PeopleOptions options;
  options.task = Task::kHug;
  options.rate_hz = 60.0;
  if (standin.name == "npy") options.skeleton = "kinect-25";
  if (standin.name == "csv") options.fill_gaps = 0.5;
  if (standin.name == "kinect") options.still_partner = true;
  const PeopleFormat& format = find_people_format(paths, standin.format);
  for (const ClipPlace& place : format.find(paths, options))
    (void)clip_bytes(read_source_clip(format, place, options).clip);
}

template <test::Standin (*make)(), std::size_t file>
Reader people_reader(const char* name) {
  return {name, [](unsigned) { return people_sample(make(), file); },
          [](std::string_view bytes) {
            static const test::Standin standin = make();
            read_people(standin, file, bytes);
          }};
}

std::string shape_sample(unsigned seed) {
  return seed % 2 == 0 ? "o box\nv 0 0 0\nv 0.1 0.2 -0.3\nv 1e-1 0 0 1\nf 1 2 3\n"
                       : R"({"box": [0.6, 0.4, 0.2], "centre": [0, 0, 0.1]})";
}
void read_shape(std::string_view bytes) { (void)read_object_keypoints(scratch_file("shape.obj", bytes)); }
void read_shape_json(std::string_view bytes) { (void)read_object_keypoints(scratch_file("shape.json", bytes)); }

std::string names_sample(unsigned /*seed*/) {
  return "nose\nleft_ear\nright_ear # an ear\nl_shoulder\nr_shoulder\nl_elbow\nr_elbow\nl_wrist\nr_wrist\nl_hip\n"
         "r_hip\nl_knee\nr_knee\nl_ankle\nr_ankle\n";
}
void read_names(std::string_view bytes) { (void)read_joint_layout(scratch_file("names.txt", bytes)); }

}  // namespace

std::vector<Reader> motion_readers() {
  return {{"bvh", bvh_sample, read_bvh_pair},
          {"pickle", pickle_sample, read_pickle},
          {"clip", clip_sample, read_clip},
          {"paired_motion", paired_motion_sample, read_paired_motion},
          people_reader<test::inter_x_standin, 0>("inter_x_skeleton"),
          people_reader<test::inter_x_standin, 2>("inter_x_order"),
          people_reader<test::inter_x_standin, 3>("inter_x_split"),
          people_reader<test::interhuman_standin, 0>("interhuman"),
          people_reader<test::core4d_standin, 0>("core4d_person"),
          people_reader<test::core4d_standin, 2>("core4d_object"),
          people_reader<test::harmony4d_standin, 0>("harmony4d"),
          people_reader<test::hi4d_standin, 1>("hi4d"),
          people_reader<test::chi3d_standin, 0>("chi3d"),
          people_reader<test::kinect_standin, 0>("positions_npz"),
          people_reader<test::npy_standin, 0>("positions_npy"),
          people_reader<test::csv_standin, 0>("positions_csv"),
          {"object_mesh", [](unsigned) { return shape_sample(0); }, read_shape},
          {"object_shape", [](unsigned) { return shape_sample(1); }, read_shape_json},
          {"joint_names", names_sample, read_names}};
}

}  // namespace duet::fuzz
