// Motions of people and robots: BVH, pickles, clips, paired motions.
#include "motion/bvh.h"
#include "motion/interaction_clip.h"
#include "motion/paired_motion.h"
#include "motion/pickle.h"
#include "tests/fuzz/archive_edit.h"
#include "tests/fuzz/reader.h"
#include "tests/motion/bvh_text.h"
#include "tests/motion/people.h"
#include "tests/motion/pickle_bytes.h"

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
  return paired_motion_bytes(motion);
}

std::string paired_motion_sample(unsigned seed) { return seed % 2 == 0 ? good_paired_motion() : std::string(kEdit); }

void read_paired_motion(std::string_view bytes) {
  static const Npz sample = Npz::parse(good_paired_motion(), "sample");
  (void)paired_motion_bytes(parse_paired_motion(archive_of(sample, bytes), "fuzz.npz"));
}

}  // namespace

std::vector<Reader> motion_readers() {
  return {{"bvh", bvh_sample, read_bvh_pair},
          {"pickle", pickle_sample, read_pickle},
          {"clip", clip_sample, read_clip},
          {"paired_motion", paired_motion_sample, read_paired_motion}};
}

}  // namespace duet::fuzz
