// Writes each reader's samples into the corpus (tests/fuzz/corpus): to be run where a format changes.
#include "duet/core/file.h"
#include "tests/fuzz/reader.h"

int main() {
  for (const duet::fuzz::Reader& reader : duet::fuzz::all_readers())
    for (const unsigned seed : {0U, 1U, 65U})
      duet::write_file(
          std::string(DUET_SOURCE_DIR "/tests/fuzz/corpus/") + reader.name + "/sample-" + std::to_string(seed),
          reader.sample(seed));
}
