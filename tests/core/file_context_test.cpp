#include "duet/core/file.h"
#include "tests/support.h"

namespace duet {
namespace {

using test::thrown_message;

template <typename Error>
std::string told(const std::string& message) {
  return thrown_message<InputError>([&] { with_file_context("a.npz", [&] { throw Error(message); }); });
}

TEST(NamingFile, PutsTheFileBeforeWhatDoesNotNameIt) {
  EXPECT_SENTENCE(told<InputError>("nothing pairs"));
  EXPECT_SENTENCE(told<std::invalid_argument>("expected frames"));
  EXPECT_SENTENCE(told<InputError>("'a.npz': key 'b'"));
}

TEST(NamingFile, SaysThatThereIsNotEnoughMemoryForAFile) {
  EXPECT_SENTENCE(thrown_message<InputError>([] { with_file_context("a.npz", [] { throw std::bad_alloc(); }); }));
}

TEST(NamingFile, LetsValuesAndOtherExceptionsThrough) {
  int value = 3;
  EXPECT_EQ(&with_file_context("a.npz", [&]() -> int& { return value; }), &value);
  EXPECT_EQ(thrown_message<MissingError>([] { with_file_context("a.npz", [] { throw MissingError("no engine"); }); }),
            "no engine");
  EXPECT_EQ(thrown_message<StorageError>([] { with_file_context("a.npz", [] { throw StorageError("disk full"); }); }),
            "disk full");
}

}  // namespace
}  // namespace duet
