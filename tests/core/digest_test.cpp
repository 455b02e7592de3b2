#include "duet/core/digest.h"

#include <functional>
#include <vector>

#include "duet/core/file.h"
#include "duet/core/require.h"
#include "tests/support.h"

namespace duet {
namespace {

RobotState some_state() {
  RobotState state;
  state.X_WB.p = {1.0, 2.0, 3.0};
  state.q = Eigen::VectorXd::LinSpaced(29, -1.0, 1.0);
  state.v = Eigen::VectorXd::Zero(29);
  return state;
}

std::string digest_of(const RobotState& state) {
  Sha256 hash;
  hash.update(state);
  return hash.hex();
}

// FIPS 180-2, appendix B.
TEST(Sha256, MatchesPublishedVectors) {
  EXPECT_EQ(sha256_hex(""), "e3b0c44298fc1c149afbf4c8996fb92427ae41e4649b934ca495991b7852b855");
  EXPECT_EQ(sha256_hex("abc"), "ba7816bf8f01cfea414140de5dae2223b00361a396177a9cb410ff61f20015ad");
  EXPECT_EQ(sha256_hex("abcdbcdecdefdefgefghfghighijhijkijkljklmklmnlmnomnopnopq"),
            "248d6a61d20638b8e5c026930c3e6039a33ce45964ff2167f6ecedd419db06c1");
  EXPECT_EQ(sha256_hex(std::string(1000000, 'a')), "cdc76e5c9914fb9281a1c7e284d73e67f1809a48a497200e046d39ccc7112cd0");
}

TEST(Sha256, PartsEqualTheWholeAndHexDoesNotEndTheHash) {
  Sha256 hash;
  hash.update("ab");
  const std::string half = hash.hex();
  EXPECT_EQ(half, sha256_hex("ab"));
  hash.update(std::string_view("c"));
  EXPECT_EQ(hash.hex(), sha256_hex("abc"));
}

TEST(Sha256, MovesWithItsContent) {
  Sha256 hash;
  hash.update("ab");
  Sha256 moved = std::move(hash);
  moved.update("c");
  EXPECT_EQ(moved.hex(), sha256_hex("abc"));
}

TEST(Sha256, TellsTheSignOfZeroApart) {
  Sha256 positive, negative;
  const std::vector<double> plus = {0.0}, minus = {-0.0};
  positive.update(plus);
  negative.update(minus);
  EXPECT_NE(positive.hex(), negative.hex());
}

TEST(Sha256, EveryFieldOfAStateCounts) {
  const std::string original = digest_of(some_state());
  EXPECT_EQ(original, digest_of(some_state()));
  const std::vector<std::function<void(RobotState&)>> changes = {
      [](RobotState& s) { s.X_WB.R.z() += 1e-15; }, [](RobotState& s) { s.X_WB.p.z() += 1e-15; },
      [](RobotState& s) { s.v_WB.x() = 1e-300; },   [](RobotState& s) { s.w_WB_B.y() = 1e-300; },
      [](RobotState& s) { s.q[28] += 1e-15; },      [](RobotState& s) { s.v[0] = 1e-300; }};
  for (const auto& change : changes) {
    RobotState state = some_state();
    change(state);
    EXPECT_NE(digest_of(state), original);
  }
}

TEST(Sha256, HashesAFileAndNamesAMissingOne) {
  const test::ScratchFolder folder;
  write_file(folder / "abc", "abc");
  EXPECT_EQ(sha256_file(folder / "abc"), sha256_hex("abc"));
  const std::string message = test::thrown_message<InputError>([&] { sha256_file(folder / "none"); });
  EXPECT_EQ(message, "cannot read '" + (folder / "none") + "': No such file or directory");
}

TEST(FileDigests, AreOfTheBytesThatWereReadWhateverBecomesOfTheFile) {
  const test::ScratchFolder folder;
  const std::string path = folder / "net";
  write_file(path, "one");
  FileDigests digests;
  std::string used;
  {
    const DigestReads reads(digests);
    used = read_file(path);
  }
  write_file(path, "two");
  EXPECT_EQ(digests.of(path), sha256_hex(used));
  EXPECT_EQ(digests.find(folder / "other/../net"), sha256_hex(used));
  EXPECT_EQ(digests.find(folder / "absent"), "");
  FileDigests later;
  EXPECT_EQ(later.of(path), sha256_hex("two"));  // one that nobody has read is read now
}

TEST(FileDigests, AFileThatChangesBetweenTwoReadsIsRefused) {
  const test::ScratchFolder folder;
  const std::string path = folder / "net";
  write_file(path, "one");
  FileDigests digests, outer;
  const DigestReads around(outer);
  {
    const DigestReads reads(digests);
    read_file(path);
    read_file(path);
    write_file(path, "two");
    EXPECT_SENTENCE(test::thrown_message<InputError>([&] { read_file(path); }));
  }
  EXPECT_EQ(outer.find(path), sha256_hex("one"));
}

}  // namespace
}  // namespace duet
