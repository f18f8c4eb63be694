"""What a log is, and whether it can be what it says, before any filter sees it: ``navfuse inspect``.

:func:`navfuse.inspection.inspect.inspect` is the whole of it. Every group of checks has a module: the file as such
(:mod:`.recognise`), stamps (:mod:`.time_checks`), inertial logs (:mod:`.imu_checks` with :mod:`.channel_checks` and
:mod:`.imu_unit_checks`, :mod:`.rest`), fixes (:mod:`.gnss_checks` with :mod:`.motion_checks` and
:mod:`.sigma_checks`) and logs against each other (:mod:`.clock_checks`, :mod:`.pair_checks`, :mod:`.turn_checks`,
:mod:`.sign_checks`, :mod:`.halves`).
The rules that the readers know already are asked there, not written again; what is added here needs a guess, or a
second log.
"""
