// Contents of each flavour of pickle beyond NumPy's own arrays (tests/formats holds the tests of those).
#include <fmt/format.h>
#include <gmock/gmock.h>
#include <zlib.h>

#include "duet/archives/npy/npz.h"
#include "duet/archives/pickle/pickle_files.h"
#include "duet/archives/pickle/pickle_machine.h"
#include "duet/archives/zip/zip.h"
#include "duet/core/require.h"
#include "tests/archives/pickle_bytes.h"
#include "tests/support.h"

namespace duet {
namespace {

using test::PickleWriter;
using test::thrown_message;
using ::testing::ElementsAre;
using ::testing::HasSubstr;

constexpr int kGzip = 16;

std::string compressed(const std::string& content, int wrapper = 0) {
  z_stream stream{};
  EXPECT_EQ(deflateInit2(&stream, 9, Z_DEFLATED, MAX_WBITS + wrapper, 9, Z_DEFAULT_STRATEGY), Z_OK);
  std::string out(deflateBound(&stream, content.size()) + 64, '\0');
  stream.next_in = reinterpret_cast<Bytef*>(const_cast<char*>(content.data()));
  stream.avail_in = static_cast<uInt>(content.size());
  stream.next_out = reinterpret_cast<Bytef*>(out.data());
  stream.avail_out = static_cast<uInt>(out.size());
  EXPECT_EQ(deflate(&stream, Z_FINISH), Z_STREAM_END);
  out.resize(stream.total_out);
  deflateEnd(&stream);
  return out;
}

std::string joblib_file(int alignment = 16, bool fortran = false) {
  PickleWriter out;
  out.raw("}(").text("before").integer(1).text("x");
  out.joblib_array(
      {2, 3},
      PickleWriter::packed(fortran ? std::vector<double>{1, 4, 2, 5, 3, 6} : std::vector<double>{1, 2, 3, 4, 5, 6}),
      "f8", fortran, alignment);
  return out.text("after").real(2.5).raw("u.").str();
}

std::vector<double> values_of(const Pickle& pickle, std::string_view key) {
  const PickleNode* node = pickle.find(pickle[pickle.root], key);
  EXPECT_NE(node, nullptr);
  return node == nullptr ? std::vector<double>{} : array_values(pickle, *node, "array");
}

std::string joblib_refusal(const std::string& bytes) {
  return thrown_message<InputError>([&] { (void)parse_joblib(bytes, "x.pkl"); });
}

TEST(Joblib, ArraysAreReadWithAnyAlignmentAndOrder) {
  for (const int alignment : {0, 8, 16, 64})
    for (const bool fortran : {false, true}) {
      const std::string bytes = joblib_file(alignment, fortran);
      const Pickle pickle = parse_joblib(bytes, "x.pkl");
      EXPECT_THAT(values_of(pickle, "x"), ElementsAre(1, 2, 3, 4, 5, 6)) << alignment;
      EXPECT_EQ(pickle.find(pickle[pickle.root], "after")->number, 2.5);
    }
}

TEST(Joblib, ZlibAndGzipAreReadOthersRefusedByName) {
  for (const int wrapper : {0, kGzip}) {
    Pickle pickle;
    {
      const std::string bytes = compressed(joblib_file(0), wrapper);
      pickle = parse_joblib(bytes, "x.pkl");
    }  // the result does not need the bytes any more
    EXPECT_THAT(values_of(pickle, "x"), ElementsAre(1, 2, 3, 4, 5, 6));
  }
  EXPECT_SENTENCE(joblib_refusal("BZh91AY"));
  EXPECT_SENTENCE(joblib_refusal("\x04\x22\x4d\x18zzzz"));
}

TEST(Joblib, DefaultdictsAreDicts) {
  PickleWriter out(3);
  out.raw("ccollections\ndefaultdict\ncbuiltins\ndict\n\x85R(").text("x").doubles({1}, {7}).raw("u.");
  EXPECT_THAT(values_of(parse_joblib(out.str(), "x.pkl"), "x"), ElementsAre(7));
  PickleWriter other(3);
  other.raw("ccollections\ndefaultdict\ncos\nsystem\n\x85R.");
  EXPECT_SENTENCE(joblib_refusal(other.str()));
}

TEST(Joblib, TruncatedAnywhereIsRefused) {
  const std::string good = joblib_file(), packed = compressed(good);
  for (std::size_t size = 0; size < good.size(); ++size)
    EXPECT_THAT(joblib_refusal(good.substr(0, size)), HasSubstr("x.pkl")) << size;
  for (std::size_t size = 1; size < packed.size(); ++size)
    EXPECT_THAT(joblib_refusal(packed.substr(0, size)), HasSubstr("'x.pkl': the compressed stream is truncated"));
}

TEST(Joblib, WhatIsNoArrayIsRefused) {
  const auto code = [](const std::string& raw) { return joblib_refusal(PickleWriter().raw(raw).str()); };
  const std::string wrapper = "cjoblib.numpy_pickle\nNumpyArrayWrapper\n)\x81";
  EXPECT_SENTENCE(code(wrapper + "}b."));
  for (const char* text : {"cnumpy\nndarray\n)\x81.", "cnumpy\nload\n.", "Q."}) EXPECT_SENTENCE(code(text));
  const std::string values(48, '\0');
  const auto array = [&](const std::vector<int>& shape, const std::string& type) {
    return joblib_refusal(PickleWriter().joblib_array(shape, values, type).raw(".").str());
  };
  EXPECT_SENTENCE(array({2, 4}, "f8"));
  EXPECT_SENTENCE(array({1 << 30, 1 << 30, 1 << 30}, "f8"));
  EXPECT_SENTENCE(array({-1, 3}, "f8"));
  EXPECT_SENTENCE(array({2, 3}, "O8"));
}

TEST(Inflate, ABombStopsAtTheLimit) {
  const std::string bomb = compressed(std::string(10'000'000, '\0'));
  EXPECT_LT(bomb.size(), 20'000U);
  EXPECT_SENTENCE(thrown_message<InputError>([&] { (void)inflated(bomb, "x", 1'000'000); }));
  EXPECT_EQ(inflated(bomb, "x", 10'000'000).size(), 10'000'000U);
  std::string damaged = compressed("hello, hello, hello, hello");
  damaged[6] ^= 0x55;
  EXPECT_SENTENCE(thrown_message<InputError>([&] { (void)inflated(damaged, "x", 1000); }));
}

TEST(Pickle, EachFlavourRefusesTheNamesOfTheOthers) {
  const auto refused = [](PickleFlavour flavour, const std::string& raw) {
    const std::string bytes = PickleWriter(2).raw(raw).str();
    return thrown_message<InputError>([&] { (void)parse_pickle(bytes, "x.pkl", flavour); });
  };
  const std::string sparse = "cscipy.sparse.csc\ncsc_matrix\n.", tensor = "ctorch._utils\n_rebuild_tensor_v2\n.";
  EXPECT_SENTENCE(refused(PickleFlavour::kNumPy, sparse));
  EXPECT_SENTENCE(refused(PickleFlavour::kJoblib, tensor));
  EXPECT_SENTENCE(refused(PickleFlavour::kNumPy, "U\x01x."));
  for (const PickleFlavour flavour : {PickleFlavour::kNumPy, PickleFlavour::kObjects, PickleFlavour::kJoblib,
                                      PickleFlavour::kModel, PickleFlavour::kTorch}) {
    EXPECT_SENTENCE(refused(flavour, "cos\nsystem\n"));
    EXPECT_SENTENCE(refused(flavour, "ios\nsystem\n"));
  }
}

// numpy.save(path, {"joints": array}): an array of one object, pickled behind the header.
std::string object_npy(const std::string& pickled) {
  std::string dictionary = "{'descr': '|O', 'fortran_order': False, 'shape': (), }";
  dictionary += std::string(63 - (10 + dictionary.size()) % 64, ' ') + "\n";
  std::string bytes("\x93NUMPY\x01\x00", 8);
  bytes += static_cast<char>(dictionary.size());
  bytes += '\0';
  return bytes + dictionary + pickled;
}

std::string pickled_object_array(const std::string& item) {
  PickleWriter out(3);
  out.call("numpy.core.multiarray", "_reconstruct").call("numpy", "ndarray").integer(0).raw("\x85").bytes("b");
  out.raw("\x87R(").integer(1).raw(")").dtype("O8", "|").raw("\x89](" + item + "etb.");
  return out.str();
}

TEST(Pickle, ProtocolsTwoToFiveAreRead) {
  for (int protocol = 0; protocol <= 7; ++protocol) {
    const std::string bytes = PickleWriter(protocol).raw("N.").str();
    if (protocol >= 2 && protocol <= 5)
      EXPECT_NO_THROW((void)parse_pickle(bytes, "x.pkl", PickleFlavour::kNumPy)) << protocol;
    else
      EXPECT_SENTENCE(thrown_message<InputError>([&] { (void)parse_pickle(bytes, "x.pkl", PickleFlavour::kNumPy); }));
  }
}

TEST(Pickle, EncodedBytesAreLatin1) {
  std::string bytes = PickleWriter(2).doubles({1}, {-1.0}).raw(".").str();  // 0xbf and 0xf0 in UTF-8: c2 bf c3 b0
  const auto read = [&] {
    const Pickle pickle = parse_pickle(bytes, "x.pkl", PickleFlavour::kNumPy);
    return array_values(pickle, pickle[pickle.root], "array");
  };
  EXPECT_THAT(read(), ElementsAre(-1.0));
  bytes.at(bytes.find('\xc3')) = '\xc4';  // a code point above 255
  EXPECT_SENTENCE(thrown_message<InputError>(read));
}

TEST(ObjectNpy, TheOneObjectIsRead) {
  PickleWriter dict(3);
  dict.raw("}").text("joints").doubles({2}, {1.5, 2.5}).raw("s");
  const std::string bytes = object_npy(pickled_object_array(dict.str().substr(2)));
  const Pickle pickle = parse_object_npy(bytes, "x.npy");
  EXPECT_THAT(values_of(pickle, "joints"), ElementsAre(1.5, 2.5));
  // Where nobody asks for objects they are refused as before.
  EXPECT_SENTENCE(thrown_message<InputError>([&] { (void)Npz::parse(zip_bytes({{"arr_0.npy", bytes}}), "x.npz"); }));
}

TEST(ObjectNpy, OtherContentIsRefused) {
  const auto refusal = [](const std::string& bytes) {
    return thrown_message<InputError>([&] { (void)parse_object_npy(bytes, "x.npy"); });
  };
  EXPECT_SENTENCE(refusal(""));
  EXPECT_SENTENCE(refusal(object_npy(pickled_object_array("NN"))));
  EXPECT_SENTENCE(refusal(object_npy("\x80\x03N.")));
  EXPECT_SENTENCE(refusal(object_npy(pickled_object_array("cos\nsystem\n"))));
  EXPECT_SENTENCE(refusal(object_npy("")));
}

TEST(Npz, OnlyWhatIsAskedForIsReadAndJudged) {
  Npz npz;
  npz.set_number("wanted", 3.0);
  npz.set_number("other", 4.0);
  const std::string good = npz.bytes();
  std::vector<ZipEntry> entries = {{"objects.npy", object_npy(pickled_object_array("N"))}, {"note.txt", "no array"}};
  read_zip(good, "good", {.entry_bytes = 1000, .total_bytes = 1000},
           [&](const std::string& entry, const std::string& content) {
             entries.push_back({entry, content});
           });
  const Npz read = Npz::parse(zip_bytes(entries), "x.npz", {"wanted", "absent"});
  EXPECT_EQ(read.number("wanted"), 3.0);
  EXPECT_FALSE(read.contains("other"));
  EXPECT_SENTENCE(thrown_message<InputError>([&] { (void)read.number("absent"); }));
}

}  // namespace
}  // namespace duet
