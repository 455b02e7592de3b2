// SHA-256 (through OpenSSL) and the chained hash of a trajectory. Equal bits give equal digests on every machine of the
// same byte order; -0.0 and 0.0 differ.
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <map>
#include <memory>
#include <span>
#include <string>
#include <string_view>

#include "duet/core/robot_state.h"

namespace duet {

class Sha256 {
 public:
  Sha256();
  ~Sha256();
  Sha256(Sha256&&) noexcept;
  Sha256& operator=(Sha256&&) noexcept;

  void update(std::span<const std::byte> bytes);
  void update(std::string_view text);
  void update(std::span<const double> values);
  void update(const RobotState& state);  // X_WB, v_WB, w_WB_B, q, v, in this order
  // 64 lower-case hex digits of everything so far; more may be added after it.
  [[nodiscard]] std::string hex() const;

 private:
  struct Context;
  std::unique_ptr<Context> context_;
};

std::string sha256_hex(std::string_view text);
// Throws InputError where the file cannot be read.
std::string sha256_file(const std::string& path);

// Digests of files by their paths, of the bytes that were used: a file that is replaced later keeps the digest of what
// was loaded. Not thread-safe.
class FileDigests {
 public:
  // The one that is known; "" where none is.
  [[nodiscard]] std::string find(const std::string& path) const;
  // The same, but a file that is not known is read now. Throws as sha256_file.
  std::string of(const std::string& path);
  // Throws InputError where another digest of that path is known: the file changed between two reads.
  void add(const std::string& path, const std::string& sha256);

 private:
  std::map<std::string, std::string> by_path_;  // absolute
};

// While it lives, each file that this thread reads whole (core/file.h) is added to `digests`; where another one lives
// already, to that one's too.
class DigestReads {
 public:
  explicit DigestReads(FileDigests& digests);
  ~DigestReads();
  DigestReads(const DigestReads&) = delete;
  DigestReads& operator=(const DigestReads&) = delete;
  // Called by read_file.
  static void note(const std::string& path, std::string_view bytes);

 private:
  FileDigests& digests_;
  DigestReads* outer_;
};

}  // namespace duet
