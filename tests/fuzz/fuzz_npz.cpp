// NPZ archives of any content.
#include "core/npz.h"
#include "tests/fuzz/reader.h"

namespace {

const std::string& sample() {
  static const std::string bytes = [] {
    duet::Npz npz;
    npz.set("numbers", std::vector<double>{1.0, -2.5, 3.0, 4.0, 5.0, 6.0}, {2, 3});
    npz.set("integers", std::vector<std::int64_t>{1, 2, 3}, {3});
    npz.set("names", std::vector<std::string>{"left", "right"});
    npz.set_text("text", "hug");
    return npz.bytes();
  }();
  return bytes;
}

}  // namespace

extern "C" std::size_t LLVMFuzzerCustomMutator(std::uint8_t* data, std::size_t size, std::size_t max_size,
                                               unsigned seed) {
  return duet::fuzz::mutate(data, size, max_size, seed, sample());
}

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  return duet::fuzz::read_or_refuse([&] {
    const duet::Npz npz = duet::Npz::parse(duet::fuzz::text_of(data, size), "fuzz.npz");
    for (const std::string& key : npz.keys()) (void)npz.numbers(key, {-1, 3});
  });
}
