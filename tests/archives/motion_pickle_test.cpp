#include <gmock/gmock.h>

#include <cmath>
#include <functional>
#include <numeric>

#include "duet/archives/pickle/pickle_fields.h"
#include "duet/core/file.h"
#include "duet/core/require.h"
#include "tests/archives/pickle_bytes.h"
#include "tests/support.h"

namespace duet {
namespace {

using test::PickleWriter;
using test::thrown_message;
using ::testing::HasSubstr;

constexpr int kFrames = 3;

// One entry of the dict, replaceable in the tests.
using Entry = std::function<void(PickleWriter&)>;

struct Entries {
  Entry fps = [](PickleWriter& out) { out.real(30.5); };
  Entry root_pos = [](PickleWriter& out) { out.doubles({3, 3}, {0, 1, 2, 3, 4, 5, 6, 7, 8}); };
  Entry root_rot = [](PickleWriter& out) { out.doubles({3, 4}, {0, 0, 0, 1, 0, 0, 0.6, 0.8, 1, 0, 0, 0}); };
  Entry dof_pos = [](PickleWriter& out) { out.doubles({3, 2}, {0.1, 0.2, 0.3, 0.4, 0.5, 0.6}); };
  Entry local_body_pos = [](PickleWriter& out) { out.none(); };
  Entry link_body_list = [](PickleWriter& out) { out.raw("](").text("pelvis").text("torso").raw("e"); };
  Entry more = [](PickleWriter&) {};
};

std::string pickle(const Entries& entries, int protocol = 4) {
  PickleWriter out(protocol);
  out.raw("}(");
  const auto put = [&](const std::string& key, const Entry& entry) {
    out.text(key);
    entry(out);
  };
  put("fps", entries.fps);
  put("root_pos", entries.root_pos);
  put("root_rot", entries.root_rot);
  put("dof_pos", entries.dof_pos);
  put("local_body_pos", entries.local_body_pos);
  put("link_body_list", entries.link_body_list);
  entries.more(out);
  return out.raw("u.").str();
}

std::string refusal(const std::string& bytes) {
  return thrown_message<InputError>([&] { (void)parse_motion_pickle(bytes, "x.pkl"); });
}

TEST(Pickle, ReadsTheSameFromEveryProtocol) {
  for (const int protocol : {2, 3, 4, 5}) {
    const PickledMotion read = parse_motion_pickle(pickle({}, protocol), "x.pkl");
    const RobotMotion& motion = read.motion;
    EXPECT_EQ(motion.rate_hz, 30.5);
    ASSERT_EQ(motion.frames(), kFrames);
    EXPECT_EQ(motion.root[2].p, Eigen::Vector3d(6, 7, 8));
    EXPECT_TRUE(motion.root[1].R.isApprox(Eigen::Quaterniond(0.8, 0, 0, 0.6), 1e-15));  // w, x, y, z
    EXPECT_EQ(motion.q.rows(), 2);
    EXPECT_EQ(motion.q(1, 2), 0.6);
    EXPECT_TRUE(motion.joint_names.empty());
    EXPECT_TRUE(read.local_body_pos.empty());
    EXPECT_EQ(read.link_body_list, (std::vector<std::string>{"pelvis", "torso"}));
    EXPECT_SENTENCE(read.verdict);
  }
}

TEST(Pickle, ReadsTypesByteOrdersAndMemoryOrders) {
  const std::vector<double> rows = {0.1, 0.2, 0.3, 0.4, 0.5, 0.6};
  const std::vector<double> columns = {0.1, 0.3, 0.5, 0.2, 0.4, 0.6};
  const std::vector<float> singles(rows.begin(), rows.end());
  const std::string packed_singles(reinterpret_cast<const char*>(singles.data()), 4 * singles.size());
  const std::vector<Entry> same = {
      [&](PickleWriter& out) {
        out.array({3, 2}, PickleWriter::packed(rows));
      },
      [&](PickleWriter& out) {
        out.array({3, 2}, PickleWriter::packed(rows, true), "f8", ">");
      },
      [&](PickleWriter& out) {
        out.array({3, 2}, PickleWriter::packed(columns), "f8", "<", true);
      },
      [&](PickleWriter& out) {
        out.array({3, 2}, packed_singles, "f4");
      },
      [&](PickleWriter& out) {  // protocol 5
        const std::string values = PickleWriter::packed(columns);
        out.call("numpy._core.numeric", "_frombuffer").raw("(\x96").little(values.size(), 8).raw(values);
        out.dtype("f8").integer(3).integer(2).raw("\x86").text("F").raw("tR");
      }};
  for (const Entry& dof_pos : same) {
    const RobotMotion motion = parse_motion_pickle(pickle({.dof_pos = dof_pos}), "x.pkl").motion;
    for (int t = 0; t < kFrames; ++t)
      for (int j = 0; j < 2; ++j) EXPECT_NEAR(motion.q(j, t), rows[2 * t + j], 1e-7);
  }
}

// Lists of numbers, of lists, of tuples and of arrays; in half precision; of a few bytes that would be many numbers.
TEST(Pickle, ReadsListsAndHalfPrecision) {
  const std::string halves("\x00\x3c\x00\x40\x00\x42\x00\x44\x00\x45\x00\x46", 12);
  const std::vector<Entry> same = {[](PickleWriter& out) {
                                     out.raw("](");
                                     for (const int t : {1, 3, 5}) out.raw("](").real(t).integer(t + 1).raw("e");
                                     out.raw("e");
                                   },
                                   [](PickleWriter& out) {
                                     out.raw("(");
                                     for (const int t : {1, 3, 5}) out.doubles({2}, {t + 0.0, t + 1.0});
                                     out.raw("t");
                                   },
                                   [&](PickleWriter& out) {
                                     out.array({3, 2}, halves, "f2");
                                   }};
  for (const Entry& dof_pos : same) {
    const RobotMotion motion = parse_motion_pickle(pickle({.dof_pos = dof_pos}), "x.pkl").motion;
    for (int t = 0; t < kFrames; ++t)
      for (int j = 0; j < 2; ++j) EXPECT_EQ(motion.q(j, t), 2 * t + j + 1);
  }
  const auto nested = [](int deep) {
    return [deep](PickleWriter& out) {
      std::string lists =
          "](K\x01"
          "eq\x01";
      for (int d = 1; d <= deep; ++d) {
        lists = "](" + lists;
        for (int i = 0; i < 200; ++i) lists += std::string("h") + static_cast<char>(d);
        lists += std::string("eq") + static_cast<char>(d + 1);
      }
      out.raw(lists);
    };
  };
  EXPECT_SENTENCE(refusal(pickle({.dof_pos = nested(5)})));
  EXPECT_SENTENCE(refusal(pickle({.dof_pos = nested(9)})));
}

TEST(Pickle, RateMayBeANumberOrANumPyScalar) {
  const std::vector<Entry> same = {
      [](PickleWriter& out) { out.integer(30); },
      [](PickleWriter& out) { out.real(30.0); },
      [](PickleWriter& out) { out.raw("\x8a\x01\x1e"); },
      [](PickleWriter& out) {
        out.call("numpy.core.multiarray", "scalar").dtype("f8").bytes(PickleWriter::packed({30.0})).raw("\x86R");
      },
      [](PickleWriter& out) { out.doubles({1}, {30.0}); },
      [](PickleWriter& out) {
        out.doubles({1, 1}, {30.0});
      },
      [](PickleWriter& out) { out.raw("](").integer(30).raw("e"); },
      [](PickleWriter& out) { out.text("30"); },
      [](PickleWriter& out) {
        out.call("numpy.core.multiarray", "scalar").dtype("u1", "|").bytes("\x1e").raw("\x86R");
      }};
  for (const Entry& fps : same) EXPECT_EQ(parse_motion_pickle(pickle({.fps = fps}), "x.pkl").motion.rate_hz, 30.0);
}

TEST(Pickle, NearlyUnitQuaternionsAreRenormalisedAndReported) {
  const PickledMotion read =
      parse_motion_pickle(pickle({.root_rot =
                                      [](PickleWriter& out) {
                                        out.doubles({3, 4}, {0, 0, 0, 1, 0, 0, 0, 0.95, 0, 0, 0, 1.02});
                                      }}),
                          "x.pkl");
  for (const Pose& X_WB : read.motion.root) EXPECT_NEAR(X_WB.R.norm(), 1.0, 1e-15);
  EXPECT_SENTENCE(read.verdict);
  const PickledMotion tied =
      parse_motion_pickle(pickle({.root_rot =
                                      [](PickleWriter& out) {
                                        out.doubles({3, 4}, {0, 0, 0, 1, 0, 0, 0, 0.95, 0, 0, 0.95, 0});
                                      }}),
                          "x.pkl");
  EXPECT_SENTENCE(tied.verdict);  // the first of those
}

TEST(Pickle, BodiesAreReadInTheirOrder) {
  std::vector<double> values(18);
  std::iota(values.begin(), values.end(), 0.0);
  const PickledMotion read = parse_motion_pickle(pickle({.local_body_pos =
                                                             [&](PickleWriter& out) {
                                                               out.doubles({3, 2, 3}, values);
                                                             }}),
                                                 "x.pkl");
  EXPECT_EQ(read.local_body_pos.points(), 2);
  EXPECT_EQ(Eigen::Vector3d(read.local_body_pos.at(2, 1)), Eigen::Vector3d(15, 16, 17));
}

// ---- what a hostile file may try
// -------------------------------------------------------------------------------------

TEST(Pickle, ForeignClassesAreRefusedByName) {
  const std::vector<Entry> attacks = {
      [](PickleWriter& out) { out.raw("cos\nsystem\n").text("id").raw("\x85R"); },
      [](PickleWriter& out) { out.text("os").text("system").raw("\x93").text("id").raw("\x85R"); },
      [](PickleWriter& out) { out.raw("cos\nsystem\n"); }};
  for (const Entry& attack : attacks)
    for (const int protocol : {2, 4}) {
      const std::string message = refusal(pickle({.more =
                                                      [&](PickleWriter& out) {
                                                        out.text("x");
                                                        attack(out);
                                                      }},
                                                 protocol));
      EXPECT_SENTENCE(message);
    }
}

TEST(Pickle, OnlyNumPysOwnNamesAreKnown) {
  for (const auto& [module, name] : {std::pair<std::string, std::string>{"builtins", "eval"},
                                     {"numpy", "load"},
                                     {"numpy.core.multiarray", "fromfile"},
                                     {"numpy", "_reconstruct"},
                                     {"_codecs", "decode"},
                                     {"collections", "OrderedDict"},
                                     {"joblib.numpy_pickle", "NumpyArrayWrapper"}})
    EXPECT_SENTENCE(refusal(PickleWriter().call(module, name).raw(".").str()));
}

TEST(Pickle, OpcodesThatMakeObjectsAreRefusedByName) {
  for (const char* code : {"\x81", "\x92", "ios\nsystem\n", "o", "P1\n", "Q", "\x82\x01", "\x97"})
    EXPECT_SENTENCE(refusal(PickleWriter().raw(code).str()));
  EXPECT_SENTENCE(refusal(PickleWriter().raw("\xff").str()));
}

TEST(Pickle, TruncatedAnywhereIsRefused) {
  for (const int protocol : {2, 4}) {
    const std::string good = pickle({}, protocol);
    for (std::size_t size = 0; size < good.size(); ++size)
      EXPECT_THAT(refusal(good.substr(0, size)), HasSubstr("x.pkl")) << size;
  }
  EXPECT_SENTENCE(refusal(""));
}

// Each of these was made to be refused by one check; the message tells which.
TEST(Pickle, BrokenMachineCodeIsRefused) {
  const auto code = [](const std::string& raw) { return refusal(PickleWriter().raw(raw).str()); };
  using namespace std::string_literals;
  for (const char* text : {"hello", "\x80\x01.", "\x80\x06."}) EXPECT_SENTENCE(refusal(text));
  for (const char* text : {".", "NN.", "(N.", "N.N", "N.", "a", "N(a", "NNa", "t", "}(Nu.", "}(NNu.", "h\x07",
                           "N(q\x01", "NNR", "N)R", "N)b", "\x8a\x09", "X\xff\xff\xff\xff"})
    EXPECT_SENTENCE(code(text));
  EXPECT_SENTENCE(code("\x8e\xff\xff\xff\xff\xff\xff\xff\xff"s));
  EXPECT_SENTENCE(code("\x95\xff\0\0\0\0\0\0\0N."s));
  EXPECT_SENTENCE(code(std::string(1'100'000, 'N')));
}

TEST(Pickle, BrokenArraysAreRefused) {
  const auto with = [](const Entry& dof_pos) { return refusal(pickle({.dof_pos = dof_pos})); };
  const std::string six = PickleWriter::packed({1, 2, 3, 4, 5, 6});
  EXPECT_SENTENCE(with([&](PickleWriter& out) { out.array({3, 2}, six.substr(1)); }));
  EXPECT_SENTENCE(with([&](PickleWriter& out) { out.array({3, 1 << 30, 1 << 30, 1 << 30}, six); }));
  EXPECT_SENTENCE(with([&](PickleWriter& out) { out.array({3, -2}, six); }));
  EXPECT_SENTENCE(with([&](PickleWriter& out) { out.array({3, 2}, six, "O"); }));
  EXPECT_SENTENCE(with([&](PickleWriter& out) { out.array({3, 2}, six, "f8", "="); }));
  EXPECT_SENTENCE(with([](PickleWriter& out) { out.raw("](").real(1).real(2).raw("e"); }));
  EXPECT_SENTENCE(with([](PickleWriter& out) { out.raw("](](").real(1).real(2).raw("e](").real(3).raw("ee"); }));
  EXPECT_SENTENCE(with([](PickleWriter& out) { out.raw("](").real(1).text("two").raw("e"); }));
  EXPECT_SENTENCE(with([](PickleWriter& out) {
    out.call("numpy.core.multiarray", "_reconstruct").call("numpy", "ndarray").integer(0).raw("\x85");
    out.bytes("b").raw("\x87R");
  }));
  EXPECT_SENTENCE(with([](PickleWriter& out) { out.call("numpy", "ndarray").integer(0).raw("\x85R"); }));
  EXPECT_SENTENCE(with([](PickleWriter& out) {
    out.call("numpy.core.multiarray", "_reconstruct").call("numpy", "dtype").integer(0).raw("\x85");
    out.bytes("b").raw("\x87R");
  }));
}

// ---- motions that are well-formed pickles but no motions
// --------------------------------------------------------------

TEST(Pickle, MotionsThatDoNotFitAreRefused) {
  const auto rotations = [](std::vector<double> values) {
    return Entries{.root_rot = [=](PickleWriter& out) { out.doubles({3, 4}, values); }};
  };
  const double nan = std::nan("");
  EXPECT_SENTENCE(refusal(pickle({.root_rot = [](PickleWriter& out) {
    out.doubles({2, 4}, {0, 0, 0, 1, 0, 0, 0, 1});
  }})));
  EXPECT_SENTENCE(refusal(pickle({.root_pos = [](PickleWriter& out) { out.doubles({3, 2}, {1, 2, 3, 4, 5, 6}); }})));
  EXPECT_SENTENCE(refusal(pickle({.dof_pos = [](PickleWriter& out) { out.doubles({6}, {1, 2, 3, 4, 5, 6}); }})));
  EXPECT_SENTENCE(refusal(pickle({.root_pos = [](PickleWriter& out) { out.doubles({1, 3}, {1, 2, 3}); }})));
  EXPECT_SENTENCE(refusal(pickle({.local_body_pos = [](PickleWriter& out) {
    out.doubles({3, 1, 3}, std::vector<double>(9));
  }})));
  EXPECT_SENTENCE(refusal(pickle({.dof_pos = [=](PickleWriter& out) { out.doubles({3, 2}, {1, 2, 3, nan, 5, 6}); }})));
  EXPECT_SENTENCE(refusal(pickle(rotations({0, 0, 0, 1, 0, 0, 0, 0, 0, 0, 0, 1}))));
  EXPECT_SENTENCE(refusal(pickle(rotations({0, 0, 0, 1, 0, 0, 0, 1, 0, 0, 0, 1.2}))));
  EXPECT_SENTENCE(refusal(pickle({.fps = [](PickleWriter& out) { out.real(0.0); }})));
  EXPECT_SENTENCE(refusal(pickle({.fps = [=](PickleWriter& out) { out.real(nan); }})));
  EXPECT_SENTENCE(refusal(pickle({.fps = [](PickleWriter& out) { out.text("thirty"); }})));
  EXPECT_SENTENCE(refusal(pickle({.fps = [](PickleWriter& out) { out.none(); }})));
  EXPECT_SENTENCE(refusal(pickle({.link_body_list = [](PickleWriter& out) { out.raw("](").integer(1).raw("e"); }})));
}

TEST(Pickle, KeysAreChecked) {
  const auto with_more = [](PickleWriter& out) { out.text("robot_type").text("unitree_g1").text("height").real(1.7); };
  EXPECT_SENTENCE(parse_motion_pickle(pickle({.more = with_more}), "x.pkl").verdict);
  const auto with_names = [](PickleWriter& out) { out.text("dof_names").raw("](").text("a").text("b").raw("e"); };
  EXPECT_EQ(parse_motion_pickle(pickle({.more = with_names}), "x.pkl").motion.joint_names,
            (std::vector<std::string>{"a", "b"}));
  EXPECT_SENTENCE(refusal(pickle({.more = [](PickleWriter& out) { out.text("fps").real(1.0); }})));
  EXPECT_SENTENCE(refusal(PickleWriter().raw("}(").text("fps").real(30.0).raw("u.").str()));
  EXPECT_SENTENCE(refusal(pickle({.root_rot = [](PickleWriter& out) { out.none(); }})));
}

// ---- real files
// --------------------------------------------------------------------------------------------------------

TEST(Pickle, ReadsRealMotions) {
  struct Known {
    std::string file;
    double rate_hz;
    int frames;
    int joints;
  };
  for (const Known& known :
       {Known{"twist2/walk_001.pkl", 29.87626854359289, 416, 29},
        Known{"twist2/walk_003.pkl", 29.876635954452137, 490, 29},
        Known{"twist2/walk_008.pkl", 29.850459348604527, 218, 29}, Known{"gmt/squat.pkl", 59.9999885559082, 304, 23},
        Known{"gmt/dance_waltz.pkl", 33.25062034739454, 269, 23},
        Known{"gmt/basic_walk.pkl", 29.980814325303772, 1173, 23}}) {
    const std::string path = test::shared_file("data/g1_motions/" + known.file);
    if (path.empty()) GTEST_SKIP() << "not run: data/g1_motions/" << known.file << " absent";
    const PickledMotion read = read_motion_pickle(path);
    EXPECT_EQ(read.motion.rate_hz, known.rate_hz);
    EXPECT_EQ(read.motion.frames(), known.frames);
    EXPECT_EQ(read.motion.q.rows(), known.joints);
    EXPECT_EQ(read.local_body_pos.points(), 38);
    EXPECT_EQ(read.link_body_list.front(), "pelvis");
    // Walking and squatting upright: the pelvis' z axis stays within 60 degrees of vertical, at the height of a G1.
    for (const Pose& X_WB : read.motion.root) {
      ASSERT_GT((X_WB.R * Eigen::Vector3d::UnitZ()).z(), 0.5) << known.file;
      ASSERT_GT(X_WB.p.z(), 0.2);
      ASSERT_LT(X_WB.p.z(), 1.0);
    }
  }
}

TEST(Pickle, ReportsTheQuaternionsOfBasicWalk) {
  const std::string path = test::shared_file("data/g1_motions/gmt/basic_walk.pkl");
  if (path.empty()) GTEST_SKIP() << "not run: data/g1_motions/gmt/basic_walk.pkl absent";
  EXPECT_SENTENCE(read_motion_pickle(path).verdict);
}

}  // namespace
}  // namespace duet
