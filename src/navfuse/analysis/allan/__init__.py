"""Allan variance: from the record of a sensor at rest to noise terms and filter settings.

::

    values, rate   -> DeviationCurve    (deviations.deviation)      any of six deviations, with intervals
    values, rate   -> Identification    (identify.identify)         quantisation, random walks, instability, ramp
    StaticRecord   -> AllanStudy        (study.study)               every axis of a record, checked first
    AllanStudy     -> ImuErrorModel     (settings.error_model)      what a filter can carry of it
"""

from navfuse.analysis.allan.deviations import KINDS, DeviationCurve, deviation
from navfuse.analysis.allan.identify import Identification, identify
from navfuse.analysis.allan.settings import error_model
from navfuse.analysis.allan.study import AllanStudy, StudySettings, study
from navfuse.analysis.allan.terms import Term

__all__ = [
    "KINDS",
    "AllanStudy",
    "DeviationCurve",
    "Identification",
    "StudySettings",
    "Term",
    "deviation",
    "error_model",
    "identify",
    "study",
]
