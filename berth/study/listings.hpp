/// The traces that the papers print, made again: inside of `listing` (reproduce.hpp). What is wrong with a run comes
/// into `figures`.
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
