/// Reproduces the traces that the papers print; internal to `listing` (reproduce.hpp). Errors of a run go to `figures`.
#pragma once

#include "berth/study/reproduce.hpp"

namespace berth::study {

namespace paper1 {
[[nodiscard]] trace::Trace figure_9(const Conditions& conditions, Figures& figures);
}
namespace paper2 {
[[nodiscard]] trace::Trace figure_2(const Conditions& conditions, Figures& figures);
[[nodiscard]] trace::Trace table_4(const Conditions& conditions, Figures& figures);
}  // namespace paper2
namespace paper4 {
[[nodiscard]] trace::Trace table_1(const Conditions& conditions, Figures& figures);
[[nodiscard]] trace::Trace table_2(const Conditions& conditions, Figures& figures);
}  // namespace paper4

}  // namespace berth::study
