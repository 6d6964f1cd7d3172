#pragma once

#include <gtest/gtest.h>

#include <string>

#include "core/errors.h"

namespace raceloc::test {

/** The message of the InputError that `call` must throw: one line. */
template <class Call>
std::string complaint(const Call& call) {
  try {
    call();
  } catch (const InputError& e) {
    EXPECT_EQ(std::string(e.what()).find('\n'), std::string::npos) << "one line: " << e.what();
    return e.what();
  }
  ADD_FAILURE() << "no InputError";
  return "";
}

}  // namespace raceloc::test
