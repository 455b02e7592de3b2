// libFuzzer over one of the readers: `fuzz_readers NAME [corpus] [-options]`; without a name it lists them.
#include <algorithm>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <cstring>

#include "duet/core/require.h"
#include "tests/fuzz/reader.h"

extern "C" std::size_t LLVMFuzzerMutate(std::uint8_t* data, std::size_t size, std::size_t max_size);

namespace {

// Chosen once, before the first input. The reason for this static: libFuzzer's functions take nothing else.
duet::fuzz::Reader& chosen() {
  static duet::fuzz::Reader reader{};
  return reader;
}

void copy(const std::string& text, std::uint8_t* data, std::size_t& size, std::size_t max_size) {
  size = std::min(text.size(), max_size);
  std::memcpy(data, text.data(), size);
}

// A short piece of the input many times in its place: what nests, and counts that are large.
std::string repeated(const std::uint8_t* data, std::size_t size, std::size_t max_size, unsigned seed) {
  const std::size_t at = seed / 7 % size, length = std::min<std::size_t>(1 + seed / 3 % 6, size - at);
  const std::string text(reinterpret_cast<const char*>(data), size), piece = text.substr(at, length);
  std::string result = text.substr(0, at);
  while (result.size() + piece.size() + size < max_size) result += piece;
  return result + text.substr(at);
}

}  // namespace

extern "C" int LLVMFuzzerInitialize(int* argc, char*** argv) {
  const std::string name = *argc > 1 ? (*argv)[1] : "";
  for (const duet::fuzz::Reader& reader : duet::fuzz::all_readers()) {
    if (name.empty()) std::puts(reader.name);
    if (name == reader.name) chosen() = reader;
  }
  if (name.empty()) std::exit(0);
  if (chosen().read == nullptr) {
    std::fprintf(stderr, "fuzz_readers: no reader '%s'; without a name it lists them\n", name.c_str());
    std::exit(2);
  }
  std::copy(*argv + 2, *argv + *argc, *argv + 1);
  --*argc;
  return 0;
}

extern "C" std::size_t LLVMFuzzerCustomMutator(std::uint8_t* data, std::size_t size, std::size_t max_size,
                                               unsigned seed) {
  if (size < 2 || seed % 64 == 0) copy(chosen().sample(seed), data, size, max_size);
  if (size > 0 && seed % 128 == 1) copy(repeated(data, size, max_size, seed), data, size, max_size);
  return LLVMFuzzerMutate(data, size, max_size);
}

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  try {
    chosen().read({reinterpret_cast<const char*>(data), size});
  } catch (const duet::InputError&) {
  } catch (const duet::MissingError&) {  // it names an engine or a network that is not here
  }
  return 0;
}
