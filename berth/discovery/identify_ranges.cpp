// The search through the ranges: down to the lowest device, then on to the next one. At the end every gap is asked
// again.
#include "berth/discovery/identify_parts.hpp"

namespace berth::discovery {

// Finds the half that answers, if one device is in the box. Its half may seem silent because it answers late, so the
// other half counts only if it answers.
rt::Task<Result<std::optional<Box>>> Identify::surely(Run& run, const Cursor& cursor, Box box) {
  const std::array<Box, 2> halves{box.lower(), box.upper()};
  std::optional<Box> result;
  for (const Window window : {Window::quick, Window::patient}) {
    // A late answer belongs to one of the two halves and does not show to which.
    const bool again = window == Window::patient && !result;
    if (again) co_await rt::sleep_for(window_of(run, Window::patient));
    for (std::size_t i = 0; i < halves.size() && !result && !run.stopped; ++i) {
      const auto heard = co_await ask(run, cursor, halves[i], window);
      if (!heard) co_return fail(heard.error());
      if (*heard) result = halves[i];
    }
  }
  run.alone = enough_alone;
  co_return result;
}

// A device is in the box. This finds the lowest one, down to one serial number, or to one revision if the serial number
// is known. If the descent ends in silence, it goes back to the last range that answered: from the top, a device that
// loses one question in twenty would never be reached. Empty: no device is there any more, or none ever was.
rt::Task<Result<std::optional<Box>>> Identify::descend(Run& run, const Cursor& cursor, Box box) {
  const bool by_serial = box.serial_low != box.serial_high;
  run.alone = by_serial ? 0 : enough_alone;
  Descent way{.box = box, .answered = box};
  const auto arrived = [&] { return by_serial ? way.box.serial_low == way.box.serial_high : way.box.single(); };
  std::optional<Box> result;
  while (!arrived() || (way.assumed > 0 && (way.back > 0 || run.care == Run::Care::most))) {
    const bool sure = run.care == Run::Care::wary && run.alone >= enough_alone && !arrived();
    bool on = false;
    if (sure) {
      const auto half = co_await surely(run, cursor, way.box);
      if (!half) co_return fail(half.error());
      on = *half || way.go_back(run);
      if (*half) way.go_on(**half);
    } else {
      const auto heard = co_await step(run, cursor, way, arrived());
      if (!heard) co_return fail(heard.error());
      on = *heard;
    }
    if (run.stopped && by_serial) run.left_at = way.answered;
    if (run.stopped || !on) co_return result;
  }
  result = way.box;
  co_return result;
}

// One question on the way down. False: nothing is there, however often it is asked.
rt::Task<Result<bool>> Identify::step(Run& run, const Cursor& cursor, Descent& way, bool arrived) {
  const bool check = arrived || way.assumed >= most_assumed;
  const Box asked = check ? way.box : way.box.lower();
  const Window window = check || way.back > 0 ? Window::patient : Window::quick;
  const auto heard = co_await ask(run, cursor, asked, window);
  if (!heard) co_return fail(heard.error());
  if (run.stopped) co_return true;
  if (run.late_yes && way.silent) {  // the range was not empty, its device was only slow
    way.box = *std::exchange(way.silent, std::nullopt);
    way.assumed = 0;
    co_return true;
  }
  way.silent.reset();
  if (*heard) {
    way.go_on(asked);
  } else if (check) {
    co_return way.go_back(run);
  } else {
    way.silent = asked;
    way.box = way.box.upper();
    ++way.assumed;
  }
  co_return true;
}

rt::Task<Result<void>> Identify::lowest_in(Run& run, Cursor& cursor, Box box) {
  const Run::Care before = run.care;
  const auto left = co_await descend(run, cursor, box);
  if (!left) co_return fail(left.error());
  cursor.open = std::exchange(run.left_at, std::nullopt);
  if (run.over()) co_return Result<void>{};
  if (!*left) {
    run.more_care();
    if (before != Run::Care::none) patience_.renew();
    // The range is asked again, with more patience. After the most careful attempt, the closing questions find the
    // rest.
    if (before == Run::Care::most) cursor.next = std::uint64_t{box.serial_high} + 1;
    co_return Result<void>{};
  }
  const Box one = **left;
  const auto there = co_await device_in(run, cursor, one);
  if (!there) co_return fail(there.error());
  if (run.stopped && *there != Sweep::found) co_return Result<void>{};
  cursor.next = std::uint64_t{one.serial_low} + 1;
  if (*there != Sweep::found) co_return Result<void>{};
  run.less_care();
  const std::uint64_t apart = one.serial_low - std::uint64_t{cursor.last};
  if (cursor.any) {
    cursor.apart = cursor.apart == 0 ? apart : (cursor.apart + apart) / 2;
    // A hole in a row does not end the row.
    const bool hole = cursor.row >= 2 && apart % cursor.stride == 0;
    if (!hole) cursor.row = 0;
    if (!hole) cursor.stride = static_cast<std::uint32_t>(apart);
    cursor.width = std::max(least_width, 2 * cursor.apart);
  } else {
    cursor.width = least_width;
  }
  cursor.any = true;
  cursor.last = one.serial_low;
  cursor.guesses = true;
  co_return Result<void>{};
}

// Asks for the next device of a row by name. True: it is there, or is known.
rt::Task<Result<bool>> Identify::guess(Run& run, Cursor& cursor) {
  const std::uint64_t serial = std::uint64_t{cursor.last} + cursor.stride;
  cursor.guesses = false;
  if (serial >= all_serials || serial < cursor.next || cursor.revisions.empty()) co_return false;
  const auto wanted = static_cast<std::uint32_t>(serial);
  const LssAddress device{cursor.kind.type.vendor, cursor.kind.type.product, cursor.revisions.front(), wanted};
  const std::vector<R_SN> known = run.known_of(cursor.kind);
  const bool is_known = std::ranges::find(known, device.r_sn()) != known.end();
  bool there = is_known;
  if (!is_known) {
    const auto tried = co_await proven(run, cursor, device, true);
    if (!tried) co_return fail(tried.error());
    there = *tried == Sweep::found;
  }
  if (there) {
    cursor.apart = (cursor.apart + cursor.stride) / 2;
    cursor.last = wanted;
    cursor.next = serial + 1;
    cursor.guesses = true;
    ++cursor.row;
  } else if (cursor.row >= 2 && !run.options.configured && !run.stopped) {
    const auto left = co_await blank_left(run);
    if (!left) co_return fail(left.error());
  }
  co_return there;
}

rt::Task<Result<void>> Identify::sweep(Run& run, Cursor& cursor, std::uint64_t end) {
  while (cursor.next < end && !run.over()) {
    run.tell(cursor.next, cursor.quiet.size());
    if (cursor.open) {
      const Box box = *std::exchange(cursor.open, std::nullopt);
      const auto done = co_await lowest_in(run, cursor, box);
      if (!done) co_return fail(done.error());
      continue;
    }
    if (cursor.guesses) {
      const auto there = co_await guess(run, cursor);
      if (!there) co_return fail(there.error());
      if (*there || run.over()) continue;
    }
    const std::uint64_t low = cursor.next;
    const std::uint64_t limit = std::min(end, run.next_known(cursor.kind, low));
    if (limit == low) {
      ++cursor.next;
      continue;
    }
    const std::uint64_t width = cursor.width == 0 ? first_width : cursor.width;
    const std::uint64_t high = std::min(limit, low + width);
    const Box box = box_of(cursor.kind, low, high);
    const auto heard = co_await ask(run, cursor, box, Window::quick);
    if (!heard) co_return fail(heard.error());
    if (run.stopped) break;
    if (*heard) {
      const auto done = co_await lowest_in(run, cursor, box);
      if (!done) co_return fail(done.error());
    } else {
      cursor.next = high;
      cursor.width = std::min(all_serials, width * widens);
    }
  }
  co_return Result<void>{};
}

// Every gap is asked with the longest window. True: all were silent.
rt::Task<Result<bool>> Identify::close(Run& run, Cursor& cursor) {
  const Box all = box_of(cursor.kind, 0, all_serials);
  const std::vector<Box> open = gaps(all, run.known_of(cursor.kind));
  bool quiet = true;
  for (std::size_t i = 0; i < open.size() && !run.over(); ++i) {
    const Box box = open[i];
    if (std::ranges::find(cursor.quiet, box) != cursor.quiet.end()) continue;
    // Earlier quick questions may still fill the receive buffer of a late device.
    co_await rt::sleep_until(run.haste_until);
    const auto heard = co_await ask(run, cursor, box, Window::bound);
    if (!heard) co_return fail(heard.error());
    if (!*heard) cursor.quiet.push_back(box);
    if (run.stopped) break;
    if (!*heard) continue;
    quiet = false;
    if (box.serial_low == box.serial_high) {
      const auto there = co_await device_in(run, cursor, box);
      if (!there) co_return fail(there.error());
      continue;
    }
    Cursor part = cursor;
    part.next = box.serial_low;
    part.width = std::uint64_t{box.serial_high} - box.serial_low + 1;  // a device is there
    part.any = false;
    part.guesses = false;
    part.row = 0;
    const std::uint64_t end = part.next + part.width;
    const auto swept = co_await sweep(run, part, end);
    if (!swept) co_return fail(swept.error());
    cursor.revisions = part.revisions;
  }
  co_return quiet;
}

}  // namespace berth::discovery
