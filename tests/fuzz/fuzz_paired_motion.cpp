// Paired motions: raw bytes, or edits of a good one.
#include "motion/paired_motion.h"
#include "tests/fuzz/archive_edit.h"
#include "tests/fuzz/reader.h"
#include "tests/motion/people.h"

namespace {

const std::string& sample() {
  static const std::string bytes = [] {
    duet::PairedMotion motion;
    motion.clip_id = "x";
    motion.phases = {.act_begin = 1, .act_end = 2};
    motion.robot.joint_names = {"a", "b"};
    motion.robot.root.resize(3);
    motion.robot.q = Eigen::MatrixXd::Zero(2, 3);
    motion.partner = duet::test::moving_person(3, 50.0, {1, 0, 0});
    motion.source_partner = motion.partner;
    motion.source_reactor = duet::test::moving_person(3, 50.0, {0, 0, 0});
    motion.reshaped = duet::PointTracks(3, 16);
    motion.loss = {{"total", {2.0, 1.0}}};
    motion.settings = {{"mode", "paper"}};
    return duet::paired_motion_bytes(motion);
  }();
  return bytes;
}

const duet::Npz& sample_archive() {
  static const duet::Npz npz = duet::Npz::parse(sample(), "sample");
  return npz;
}

}  // namespace

extern "C" std::size_t LLVMFuzzerCustomMutator(std::uint8_t* data, std::size_t size, std::size_t max_size,
                                               unsigned seed) {
  return duet::fuzz::mutate(data, size, max_size, seed, seed % 2 == 0 ? sample() : "edit");
}

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  const std::string_view bytes = duet::fuzz::text_of(data, size);
  return duet::fuzz::read_or_refuse([&] {
    const duet::PairedMotion motion = duet::parse_paired_motion(
        bytes.starts_with("PK") ? std::string(bytes) : duet::fuzz::edited_archive(sample_archive(), bytes), "fuzz.npz");
    (void)duet::paired_motion_bytes(motion);  // what was read can be written
  });
}
