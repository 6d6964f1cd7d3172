/** \file
 * Bytes that are the same on every machine: numbers little-endian, texts with their length before them, matrices by
 * rows. What a map and the stages of a build keep in blobs. */
#pragma once

#include <Eigen/Core>
#include <array>
#include <cstdint>
#include <cstring>
#include <stdexcept>
#include <string>
#include <type_traits>
#include <vector>

namespace raceloc {

using Bytes = std::vector<char>;

template <class Number>
using BitsOf = std::conditional_t<sizeof(Number) == 4, std::uint32_t, std::uint64_t>;

template <class Number, class = std::enable_if_t<std::is_arithmetic_v<Number>>>
void append(Bytes& bytes, Number value) {
  static_assert(sizeof(Number) == 4 || sizeof(Number) == 8);
  BitsOf<Number> bits{};
  std::memcpy(&bits, &value, sizeof bits);
  std::array<char, sizeof bits> little_endian{};
  for (std::size_t i = 0; i < sizeof bits; ++i) little_endian[i] = static_cast<char>(bits >> (8 * i) & 0xFF);
  bytes.insert(bytes.end(), little_endian.begin(), little_endian.end());
}
inline void append(Bytes& bytes, const std::string& text) {
  append(bytes, static_cast<std::uint64_t>(text.size()));
  bytes.insert(bytes.end(), text.begin(), text.end());
}
template <class Number>
void append(Bytes& bytes, const std::vector<Number>& values) {  ///< without their number
  bytes.reserve(bytes.size() + values.size() * sizeof(Number));
  for (const Number value : values) append(bytes, value);
}
template <class Derived>
void append(Bytes& bytes, const Eigen::MatrixBase<Derived>& matrix) {
  for (Eigen::Index row = 0; row < matrix.rows(); ++row)
    for (Eigen::Index column = 0; column < matrix.cols(); ++column) append(bytes, matrix(row, column));
}

/** Takes out what append() put in, in the same order. \throws std::out_of_range if the bytes end before. */
class ByteReader {
 public:
  /** Keeps a reference. */
  explicit ByteReader(const Bytes& bytes) : x_bytes(bytes) {}

  template <class Number>
  Number number() {
    const char* at = take(sizeof(Number));
    BitsOf<Number> bits = 0;
    for (std::size_t i = 0; i < sizeof bits; ++i)
      bits |= static_cast<BitsOf<Number>>(static_cast<unsigned char>(at[i])) << (8 * i);
    Number value{};
    std::memcpy(&value, &bits, sizeof value);
    return value;
  }
  std::string text() {
    const auto size = static_cast<std::size_t>(number<std::uint64_t>());
    return {take(size), size};
  }
  template <class Number>
  std::vector<Number> numbers(std::size_t count) {
    if (count > left() / sizeof(Number)) throw std::out_of_range("ByteReader: the bytes end too early");
    std::vector<Number> values(count);
    for (Number& value : values) value = number<Number>();
    return values;
  }
  template <class Matrix>
  Matrix matrix() {  ///< of a fixed size
    Matrix values;
    for (Eigen::Index row = 0; row < values.rows(); ++row)
      for (Eigen::Index column = 0; column < values.cols(); ++column)
        values(row, column) = number<typename Matrix::Scalar>();
    return values;
  }
  [[nodiscard]] std::size_t left() const { return x_bytes.size() - x_at; }

 private:
  const char* take(std::size_t size) {
    if (size > left()) throw std::out_of_range("ByteReader: the bytes end too early");
    const char* at = x_bytes.data() + x_at;
    x_at += size;
    return at;
  }
  const Bytes& x_bytes;
  std::size_t x_at = 0;
};

/** 32 hexadecimal digits. MD5 finds damage and tells contents apart; it is no protection against forgery. */
[[nodiscard]] std::string md5Of(const Bytes& bytes);

}  // namespace raceloc
