// SHA-256 (through OpenSSL) and the chained hash of a trajectory. Equal bits give equal digests on every machine of the
// same byte order; -0.0 and 0.0 differ.
#pragma once

#include <Eigen/Core>
#include <cstdint>
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

}  // namespace duet
