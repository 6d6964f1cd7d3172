/** \file
 * An estimate as the rest of the car reads it. */
#pragma once

#include <cstddef>
#include <optional>
#include <string>

#include "pipeline/localizer.h"

namespace raceloc {

/** What is known of the car at the moment of an output, beside the output. */
struct OutputContext {
  std::size_t number;           ///< of the output, from 1: whoever listens sees what was lost
  std::optional<double> age_s;  ///< from the output's stamp until now; none when a log is played at no pace
};

/** One line without its end; the fields are described in share/clients/README.md. Same input, same text. */
[[nodiscard]] std::string outputJson(const LocalizerOutput& output, const OutputContext& context);

}  // namespace raceloc
