#include "berth/study/reproduce.hpp"

#include "berth/study/listings.hpp"

namespace berth::study {

Figures reproduce(const Conditions& conditions) {
  Figures figures;
  reproduce_paper1(conditions, figures);
  reproduce_paper2(conditions, figures);
  reproduce_paper3(figures);
  reproduce_paper4(conditions, figures);
  return figures;
}

const std::vector<std::string_view>& listings() {
  static const std::vector<std::string_view> names{"paper1-figure9", "paper2-figure2", "paper2-table4", "paper4-table1",
                                                   "paper4-table2"};
  return names;
}

std::optional<Listing> listing(std::string_view name, const Conditions& c) {
  using enum Listing::Form;
  const std::string own(name);
  Figures figures;
  const auto made = [&](const char* title, trace::Trace trace, Listing::Form form) {
    return Listing{own, title, std::move(trace), form, figures.wrong};
  };
  if (name == "paper1-figure9")
    return made("RAND finds five slaves (paper 1, Figure 9)", paper1::figure_9(c, figures), messages);
  if (name == "paper2-figure2")
    return made("Complete negotiation cycle (paper 2, Figure 2)", paper2::figure_2(c, figures), view);
  if (name == "paper2-table4")
    return made("CAN trace of two nodes (paper 2, Table 4)", paper2::table_4(c, figures), times);
  if (name == "paper4-table1")
    return made("LSS Fastscan cycle without feedback (paper 4, Table 1)", paper4::table_1(c, figures), messages);
  if (name == "paper4-table2")
    return made("LSS Fastscan cycle with feedback (paper 4, Table 2)", paper4::table_2(c, figures), messages);
  return std::nullopt;
}

}  // namespace berth::study
