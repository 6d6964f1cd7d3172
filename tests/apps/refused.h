/** \file
 * Commands that must end in one clear line and exit 2. */
#pragma once

#include <gmock/gmock.h>

#include <algorithm>
#include <filesystem>
#include <string>
#include <vector>

#include "apps/apps.h"

namespace raceloc::test {

class BadInput : public ::testing::Test {
 protected:
  /** Runs a command that must be refused in one line which contains all of `named`. `program` speaks, when it is not
   * the command's first word. */
  void expectRefused(const std::vector<std::string>& command, const std::vector<std::string>& named,
                     const std::string& program = "") const {
    const auto result = runCommand(command);
    EXPECT_EQ(result.exit_code, 2);
    EXPECT_EQ(std::count(result.err.begin(), result.err.end(), '\n'), 1) << result.err;
    EXPECT_THAT(
        result.err,
        ::testing::StartsWith(
            (program.empty() ? std::filesystem::path(command[0]).filename().string() : program) + ": "));
    for (const auto& name : named) EXPECT_THAT(result.err, ::testing::HasSubstr(name));
    EXPECT_THAT(out.names(), ::testing::IsEmpty());
  }
  TemporaryFolder in, out;
};

}  // namespace raceloc::test
