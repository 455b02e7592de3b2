// Interaction clips: raw bytes, or edits of a good clip.
#include "motion/interaction_clip.h"
#include "tests/fuzz/archive_edit.h"
#include "tests/fuzz/reader.h"
#include "tests/motion/people.h"

namespace {

const std::string& sample() {
  static const std::string bytes = [] {
    duet::InteractionClip clip = duet::test::two_people(3);
    clip.phases = {.act_begin = 1, .act_end = 2};
    clip.contacts = {{.begin = 1, .end = 2, .joint_a = 22, .joint_b = 23}};
    return duet::clip_bytes(clip);
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
    const duet::InteractionClip clip = duet::parse_clip(
        bytes.starts_with("PK") ? std::string(bytes) : duet::fuzz::edited_archive(sample_archive(), bytes), "fuzz.npz");
    (void)duet::clip_bytes(duet::mirrored(clip));  // what was read can be written
  });
}
