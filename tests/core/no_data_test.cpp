#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "duet/archives/npy/npz.h"
#include "duet/core/file.h"
#include "duet/core/require.h"
#include "tests/support.h"

namespace duet {
namespace {

using std::string_view_literals::operator""sv;
using test::ScratchFolder;

constexpr std::string_view kPointer = "version https://git-lfs.github.com/spec/v1\noid sha256:4d7a2146\nsize 12345\n";

TEST(NoData, EveryKindIsToldByItsFirstBytes) {
  for (const std::string_view bytes :
       {kPointer, "/annex/objects/SHA256E-s10--ab.npz\n"sv, "<!DOCTYPE html>\n<html>"sv, "\n  <HTML lang=\"en\">"sv,
        "\xef\xbb\xbf<!doctype HTML>"sv, "<?xml version=\"1.0\"?>\n<!DOCTYPE html PUBLIC"sv,
        "<?xml version=\"1.0\"?><Error><Code>NoSuchKey</Code>"sv, "\xff\xfe<\0r\0o\0b\0"sv, "\xfe\xff\0c\0l\0i\0p"sv,
        "H\0I\0E\0R\0"sv, "\xff\xfe\0\0H\0\0\0I\0\0\0E\0\0\0R\0\0\0"sv, "MATLAB 5.0 MAT-file, Platform: GLNXA64"sv,
        "PK\x03\x04\x14\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\x13\0\0\0[Content_Types].xml"sv})
    EXPECT_SENTENCE(no_data_fault(bytes));
}

TEST(NoData, WhatMayBeDataIsNotToldSo) {
  Npz npz;
  npz.set("numbers", std::vector<double>{1.0}, {1});
  const std::string archive = npz.bytes();
  // The last: a safetensors header of 65279 bytes, whose length begins like a mark of UTF-16.
  for (const std::string_view bytes :
       {std::string_view(archive), ""sv, "a,b\n1,2\n"sv, "HIERARCHY\nROOT Hips"sv,
        "<?xml version=\"1.0\"?>\n<robot name=\"x\"/>"sv, "<robot name=\"html\"/>"sv, "\x93NUMPY\x01\0v\0{'descr'"sv,
        "\x80\x04\x95"sv, "\x08\x07\x12\x07pytorch"sv, "\x3a\0\0\0\0\0\0\0{\"weight\""sv,
        "\xff\xfe\0\0\0\0\0\0{\"weight\":{\"dtype\""sv})
    EXPECT_EQ(no_data_fault(bytes), "") << bytes;
}

TEST(ReadData, NamesTheFileAndWhatItIs) {
  const ScratchFolder folder;
  for (const char* ending : {".npz", ".onnx", ".bvh", ".csv", ".pkl"}) {
    const std::string path = folder / (std::string("x") + ending);
    write_file(path, kPointer);
    const auto fault = [&](auto&& read) { return test::thrown_message<InputError>([&] { read(path); }); };
    for (const std::string& message :
         {fault([](const std::string& p) { read_data(p); }), fault([](const std::string& p) { read_plain_text(p); }),
          fault([](const std::string& p) { read_file(p); }), fault([](const std::string& p) { read_text(p); }),
          fault([](const std::string& p) { require_data(p); }), fault([](const std::string& p) { Npz::load(p); })})
      EXPECT_SENTENCE(message) << path;
  }
  write_file(folder / "empty", "");
  EXPECT_EQ(test::thrown_message<InputError>([&] { read_plain_text(folder / "empty"); }),
            "'" + (folder / "empty") + "': the file is empty");
  require_data(folder / "");  // a folder says nothing
  write_file(folder / "report.html", "<!doctype html>");
  EXPECT_EQ(read_file(folder / "report.html"), "<!doctype html>") << "a page by its name";
  write_file(folder / "report.yaml", "<!doctype html>");
  EXPECT_SENTENCE(test::thrown_message<InputError>([&] { read_file(folder / "report.yaml"); }));
}

TEST(ReadText, TakesAwayTheMarkAndForeignLineEnds) {
  const ScratchFolder folder;
  write_file(folder / "text", "\xef\xbb\xbfone\r\ntwo\rthree\n\rfour\r\r\n");
  EXPECT_EQ(read_plain_text(folder / "text"), "one\ntwo\nthree\n\nfour\n\n");
  EXPECT_EQ(plain_text("a\xef\xbb\xbf"
                       "b"),
            "a\xef\xbb\xbf"
            "b");
  EXPECT_EQ(read_head(folder / "text", 6), "\xef\xbb\xbfone");
}

}  // namespace
}  // namespace duet
