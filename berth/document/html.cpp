#include "berth/document/html.hpp"

#include <fmt/format.h>

#include "berth/base/words.hpp"

namespace berth::document {
namespace {

// For light and dark screens, and for paper.
constexpr const char* style = R"(
:root{color-scheme:light dark;--line:#c8ccd2;--soft:#f2f4f7;--link:#0b57d0}
@media(prefers-color-scheme:dark){:root{--line:#454b54;--soft:#23272e;--link:#8ab4f8}}
@media print{:root{color-scheme:light}nav{display:none}table{page-break-inside:auto}tr{page-break-inside:avoid}}
body{font:14px/1.45 system-ui,sans-serif;margin:1.5rem auto;max-width:75rem;padding:0 1rem}
h1{font-size:1.5rem}h2{font-size:1.15rem;margin-top:2rem}
a{color:var(--link)}
.wide{overflow-x:auto}
table{border-collapse:collapse;font-variant-numeric:tabular-nums}
th,td{border:1px solid var(--line);padding:.2rem .5rem;text-align:left;vertical-align:top}
th{background:var(--soft)}
td.n{text-align:right;white-space:nowrap}
.bad{font-weight:600}
)";

}  // namespace

std::string page(std::string_view title, const std::string& body, bool up) {
  return fmt::format(
      "<!doctype html>\n<html lang=\"en\"><head><meta charset=\"utf-8\">\n"
      "<meta name=\"viewport\" content=\"width=device-width\">\n"
      "<meta http-equiv=\"Content-Security-Policy\" content=\"default-src 'none'; style-src 'unsafe-inline'\">\n"
      "<title>{0}</title><style>{1}</style></head>\n<body>\n{2}<h1>{0}</h1>\n{3}</body></html>\n",
      markup(title), style, up ? "<nav><a href=\"index.html\">The machine</a></nav>\n" : "", body);
}

Table::Table(const std::vector<std::string>& heads) {
  for (const auto& head : heads) head_ += "<th>" + markup(head) + "</th>";
}

Table& Table::cell(std::string_view text) {
  row_ += "<td>" + markup(text) + "</td>";
  return *this;
}

Table& Table::number(std::string_view text) {
  row_ += "<td class=\"n\">" + markup(text) + "</td>";
  return *this;
}

Table& Table::html(std::string_view made) {
  row_ += "<td>" + std::string(made) + "</td>";
  return *this;
}

void Table::end_row() {
  rows_ += "<tr>" + row_ + "</tr>\n";
  row_.clear();
}

std::string Table::made() const {
  if (rows_.empty()) return {};
  return "<div class=\"wide\"><table><thead><tr>" + head_ + "</tr></thead><tbody>\n" + rows_ +
         "</tbody></table></div>\n";
}

}  // namespace berth::document
