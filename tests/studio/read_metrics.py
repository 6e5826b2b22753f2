#!/usr/bin/env python3
"""Reads a page of metrics from standard input by Prometheus' client library: read_metrics.py text|open METRICS.

Exit status 1: it does not read it, has another number of metrics, or lacks the slot with the odd name.
"""
import sys

from prometheus_client.openmetrics.parser import text_string_to_metric_families as read_open
from prometheus_client.parser import text_string_to_metric_families as read_text

ODD = 'a "quoted"\\ name\\u000aof two lines, {with="labels"} # and é'

page = sys.stdin.buffer.read().decode("utf-8")
families = list((read_open if sys.argv[1] == "open" else read_text)(page))
if len(families) != int(sys.argv[2]):
    sys.exit(f"{len(families)} metrics, not {sys.argv[2]}: {[family.name for family in families]}")
slots = {sample.labels.get("slot") for family in families for sample in family.samples}
if ODD not in slots:
    sys.exit(f"{ODD!r} is not among {slots}")
