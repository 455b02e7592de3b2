// BVH text, and the import of a pair of the same person.
#include "motion/bvh.h"
#include "tests/fuzz/reader.h"
#include "tests/motion/bvh_text.h"

namespace {

const std::string& sample() {
  static const std::string text = [] {
    duet::test::BvhWriter writer;
    writer.frames = 3;
    return writer.text();
  }();
  return text;
}

}  // namespace

extern "C" std::size_t LLVMFuzzerCustomMutator(std::uint8_t* data, std::size_t size, std::size_t max_size,
                                               unsigned seed) {
  return duet::fuzz::mutate(data, size, max_size, seed, sample());
}

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  return duet::fuzz::read_or_refuse([&] {
    const duet::Bvh bvh = duet::parse_bvh(duet::fuzz::text_of(data, size), "fuzz.bvh");
    (void)duet::import_bvh_pair(bvh, bvh, duet::Task::kHandshake);
  });
}
